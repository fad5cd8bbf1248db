"""The field against sampling of the light's history, where the light moves.

    python -m tests.acceptance.history_sampling [--pictures DIR] [--size 256]

Glassner (*A model for fluorescence and phosphorescence*, 1995) gives the glow at a time as an
integral over the light before it, L(t) = Σ Λ k ∫ κ(t′) e^(−k (t − t′)) dt′, which knows no
saturation. A disk is lit from time 0 on behind a blade of 120° that turns in 4 s and has a penumbra
of 10°, so that the light on each texel is known at any time and no ray is traced.

*field*: one exact step per frame, 25 frames a second, with the light in the middle of each.
*history*: times t′ are drawn by the decay of each state, by inversion, so that only the light
itself varies; at random, or one in each of N equal parts of the probability (stratified). Both
kernels are compiled; times are those of a processor.

Truth is the rate equation, with saturation, in 100,000 exact steps in double precision. Errors are
rms over 512 texels, in % of the mean glow at that time; beside them, the mean glow itself, in the
unit of the material. `the law itself` is the error of the integral without noise, which is that of
leaving out saturation.

Equal time is meant in two ways: *per frame* of an animation, where the field has its levels from
the frame before; and *from the start*, one picture at time t, for which the field makes all steps.
Equal quality is the least power of two of stratified samples whose error is at most the field's;
`never` where the law itself is farther off.
"""

import argparse
import math
import time
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import Float32Array, FloatArray
from labrig.material import read_material
from labrig.reproduce import Field, FieldParameters

PERIOD_S, HALF_BLADE, PENUMBRA = 4.0, math.radians(60), math.radians(10)
FRAME_S, TIMES_S = 0.04, (1.0, 10.0, 100.0, 1000.0)
SPEED = 2 * math.pi / PERIOD_S
REFERENCE_STEPS, CHECKED = 100_000, 512
MAX_SAMPLES = 2**17
#: Materials of one state and of two, which decay slowly and fast.
MATERIALS = ("blue-paint", "yellow-paint", "double-wide")
#: Largest κ/k: light so weak that the law without saturation holds, and light of 0.5 %.
WEAK = (1e-4, 5e-3)
#: Largest κ/k at which the error of the law itself is told, and time in s.
SATURATIONS, SATURATED_S = (1e-3, 0.01, 0.1, 0.3, 1.0, 3.0), 200.0


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def visible(angle: float, t_s: float) -> float:
    """Return the part of the lamp that a texel sees past the blade."""
    from_blade = angle - SPEED * t_s
    from_blade -= 2 * math.pi * math.floor(from_blade / (2 * math.pi) + 0.5)
    return min(max((abs(from_blade) - HALF_BLADE) / PENUMBRA + 0.5, 0.0), 1.0)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def light_at(angle: Float32Array, t_s: float, light: Float32Array) -> None:
    """Write the light on all texels at a time."""
    for s in range(len(angle)):
        light[s] = visible(angle[s], t_s)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def true_glow(
    angle: Float32Array, k: FloatArray, kappa: FloatArray, emitted: FloatArray, t_s: float, n: int
) -> FloatArray:
    """Return the glow of the rate equation, in n exact steps (texels,)."""
    glow = np.zeros(len(angle))
    step = t_s / n
    for s in range(len(angle)):
        for state in range(len(k)):
            r = 0.0
            for j in range(n):
                own = kappa[state] * visible(angle[s], (j + 0.5) * step)
                total = own + k[state]
                r = own / total + (r - own / total) * math.exp(-total * step)
            glow[s] += emitted[state] * k[state] * r
    return glow


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def history_glow(
    angle: Float32Array,
    k: FloatArray,
    kappa: FloatArray,
    emitted: FloatArray,
    t_s: float,
    n: int,
    stratified: bool,
    seed: int,
) -> FloatArray:
    """Return the glow by n times of each state's history, drawn by its decay (texels,)."""
    np.random.seed(seed)  # noqa: NPY002 - numba's own generator
    glow = np.zeros(len(angle))
    for s in range(len(angle)):
        for state in range(len(k)):
            whole = 1 - math.exp(-k[state] * t_s)
            total = 0.0
            for j in range(n):
                u = np.random.random()  # noqa: NPY002
                place = (j + u) / n if stratified else u
                age = -math.log(1 - place * whole) / k[state]
                total += visible(angle[s], t_s - age)
            glow[s] += emitted[state] * kappa[state] * whole * total / n
    return glow


@dataclass(frozen=True, eq=False)
class Scene:
    """A lit disk of a material.

    Attributes
    ----------
    angle
        Places of the texels around the axis, shape (n,).
    k_per_s, kappa_per_s, emitted
        Decay rates, excitation in full light, and Λ over all bands, shape (states,).
    """

    angle: Float32Array
    k_per_s: FloatArray
    kappa_per_s: FloatArray
    emitted: FloatArray

    @classmethod
    def of(cls, name: str, saturation: float, angle: Float32Array) -> "Scene":
        """Return a disk of a shipped material under light with κ/k = `saturation` at most."""
        material = read_material(name)
        k = np.array([state.k_r_per_s for state in material.states])
        k_e = np.array([sum(state.k_e_per_s or ()) for state in material.states])
        emitted = np.array([sum(state.reradiation or ()) for state in material.states])
        return cls(angle, k, k_e * saturation / (k_e / k).max(), emitted)

    def field(self) -> Field:
        """Return the empty field, with one band: the lamp."""
        parameters = FieldParameters.checked(
            self.k_per_s, self.kappa_per_s[:, np.newaxis], self.emitted[:, np.newaxis]
        )
        return Field(parameters, len(self.angle))

    def truth(self, t_s: float, checked: NDArray[np.intp]) -> FloatArray:
        """Return the glow of some texels by the rate equation."""
        return np.asarray(
            true_glow(
                self.angle[checked], self.k_per_s, self.kappa_per_s, self.emitted, t_s,
                REFERENCE_STEPS,
            )
        )  # fmt: skip

    def history(self, t_s: float, n: int, seed: int, *, stratified: bool) -> FloatArray:
        """Return the glow of all texels by samples of the history."""
        return np.asarray(
            history_glow(
                self.angle, self.k_per_s, self.kappa_per_s, self.emitted, t_s, n, stratified, seed
            )
        )


def disk(size: int) -> tuple[Float32Array, NDArray[np.bool_]]:
    """Return the angles of the texels of a disk, and which pixels of its square they are."""
    at = (np.arange(size) + 0.5) / size * 2 - 1
    is_on = np.hypot(at, at[:, np.newaxis]) < 1
    angle = np.arctan2(-at[:, np.newaxis], at[np.newaxis, :]) * np.ones((size, size))
    return angle[is_on].astype(np.float32), is_on


def stepped(scene: Scene, times_s: tuple[float, ...]) -> tuple[list[FloatArray], float]:
    """Return the field's glow at some times, and its time per frame in seconds."""
    field, light = scene.field(), np.empty((1, len(scene.angle)), np.float32)
    glow, frame, began_s = [], 0, time.process_time()
    for t_s in times_s:
        while frame < round(t_s / FRAME_S):
            light_at(scene.angle, (frame + 0.5) * FRAME_S, light[0])
            field.step(light, FRAME_S)
            frame += 1
        glow.append(field.radiance()[0].astype(np.float64))
    return glow, (time.process_time() - began_s) / frame


def rms_percent(glow: FloatArray, truth: FloatArray) -> float:
    """Return the rms error in % of the mean glow."""
    return float(100 * np.sqrt(np.mean((glow - truth) ** 2)) / truth.mean())


def equal_quality(
    scene: Scene, t_s: float, checked: NDArray[np.intp], truth: FloatArray, percent: float
) -> int | None:
    """Return how many stratified samples have at most an error; None if none have."""
    some = Scene(scene.angle[checked], scene.k_per_s, scene.kappa_per_s, scene.emitted)
    n = 1
    while n <= MAX_SAMPLES:
        if rms_percent(some.history(t_s, n, n, stratified=True), truth) <= percent:
            return n
        n *= 2
    return None


def compare(name: str, saturation: float, size: int, seed: int) -> None:
    """Print a table of one material under one light."""
    angle, _ = disk(size)
    scene = Scene.of(name, saturation, angle)
    checked = np.random.default_rng(seed).choice(len(angle), CHECKED, replace=False)
    warm = Scene(angle[:8], scene.k_per_s, scene.kappa_per_s, scene.emitted)
    stepped(warm, (FRAME_S,))
    warm.history(FRAME_S, 1, seed, stratified=True)
    began_s = time.process_time()
    scene.history(10.0, 16, seed, stratified=True)
    sample_s = (time.process_time() - began_s) / 16
    glows, frame_s = stepped(scene, TIMES_S)
    states = len(scene.k_per_s)
    print(f"\n{name}, {states} state{'s' * (states > 1)}, κ/k at most {saturation:g}: "
          f"{len(angle)} texels, field {1e3 * frame_s:.2f} ms a frame, history "
          f"{1e3 * sample_s:.2f} ms a sample")  # fmt: skip
    print(f"{'':6}{'':12}{'':9}{'the law':>9}{'equal time per frame':>29}"
          f"{'equal time from the start':>30}{'equal quality':>30}")  # fmt: skip
    print(f"{'t / s':>6}{'glow':>12}{'field %':>9}{'itself %':>9}{'N':>9}{'random %':>10}"
          f"{'strata %':>10}{'N':>10}{'random %':>10}{'strata %':>10}{'N':>8}"
          f"{'× frame':>10}{'× start':>10}")  # fmt: skip
    for t_s, glow in zip(TIMES_S, glows, strict=True):
        truth = scene.truth(t_s, checked)
        own = rms_percent(glow[checked], truth)
        some = Scene(angle[checked], scene.k_per_s, scene.kappa_per_s, scene.emitted)
        limit = some.history(t_s, MAX_SAMPLES, 1, stratified=True)
        row = f"{t_s:6g}{truth.mean():12.4g}{own:9.4f}{rms_percent(limit, truth):9.4f}"
        frames = round(t_s / FRAME_S)
        for equal_s in (frame_s, frames * frame_s):
            n = max(1, round(equal_s / sample_s))
            errors = [
                rms_percent(some.history(t_s, n, seed + 1, stratified=how), truth)
                for how in (False, True)
            ]
            row += f"{n:10d}" + "".join(f"{error:10.4f}" for error in errors)
        found = equal_quality(scene, t_s, checked, truth, own)
        if found is None:
            print(f"{row}{'never':>8}")
        else:
            times = (found * sample_s / frame_s, found * sample_s / (frames * frame_s))
            print(f"{row}{found:8d}{times[0]:10.3g}{times[1]:10.3g}")


def tell_saturation(name: str) -> None:
    """Print how wrong the law without saturation is, where the light is not weak."""
    angle, _ = disk(64)
    print(f"\n{name}, glow of the law without saturation over the true one after "
          f"{SATURATED_S:g} s")  # fmt: skip
    print(f"{'κ/k at most':>12}{'law / truth':>12}{'field / truth':>14}")
    for saturation in SATURATIONS:
        scene = Scene.of(name, saturation, angle[:CHECKED])
        truth = scene.truth(SATURATED_S, np.arange(CHECKED)).mean()
        law = scene.history(SATURATED_S, MAX_SAMPLES // 8, 1, stratified=True).mean()
        (glow,), _ = stepped(scene, (SATURATED_S,))
        print(f"{saturation:12g}{law / truth:12.4f}{glow.mean() / truth:14.5f}")


def main() -> None:
    """Print all tables, and draw the pictures if asked."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--size", type=int, default=256, help="side of the disk in texels")
    parser.add_argument("--pictures", type=Path, help="draw the pictures only, into a folder")
    options = parser.parse_args()
    if options.pictures is not None:
        from tests.acceptance.history_sampling_pictures import draw_disks, draw_effort

        draw_disks(options.pictures / "history_sampling.png", MATERIALS[0], WEAK[0])
        draw_effort(options.pictures / "history_effort.png", MATERIALS[:2], WEAK[0])
        return
    for seed, (name, saturation) in enumerate(
        [(name, saturation) for name in MATERIALS for saturation in WEAK]
    ):
        compare(name, saturation, options.size, seed)
    tell_saturation(MATERIALS[0])


if __name__ == "__main__":
    main()
