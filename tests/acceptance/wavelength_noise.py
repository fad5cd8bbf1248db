"""Noise of paths of single wavelengths against paths that are folded in all bands at once.

    python -m tests.acceptance.wavelength_noise [--paths 196608]

A path of single wavelengths draws its shifts from the mixture (Hua et al., section 6); a fold
multiplies a path without wavelength by the whole matrix at each vertex. Both see the same surfaces,
re-radiating as the same mixture:

*furnace*: a closed box, all walls glow and are of one paper; exact (I − M)⁻¹ e.
*sphere*: a white closed sphere, a part of which is the paper seen and a part a lamp. Inside
a Lambertian sphere the next vertex is everywhere with the same probability, so no ray is traced.
*plane*: the paper on the axis of a disk lamp of radius R at height h; exact
M · lamp · R²/(R² + h²).

Noise is the standard deviation of one path's estimate, over the mean light, for the mean of the 24
bands of 20 nm in the root of squares, and for the luminance Y. At equal time it is multiplied by
the root of a path's time: what is left after one second of a processor. `× time` is how many times
as long as the fold a method takes for the same noise. Rays are not traced here: each vertex, and
each connexion to the lamp, is taken to cost 0.3 µs, as compiled rays do in a small scene, or 10 µs,
as in a large one. The error of Y is in σ and in % of the exact one; that of the fold is
the width of its bands.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.fit import fit_mixture
from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix, ReradiationMixture, corrected, read_reradiation
from labrig.optics import CIE_1931, observer
from labrig.reproduce import LampWavelengths, WavelengthShift, direct_light, rotated_wavelengths
from tests.real_data import SHARED

LOW_NM, HIGH_NM, BANDS, FINE = 300.0, 780.0, 24, 480
EDGES_NM = np.linspace(LOW_NM, HIGH_NM, BANDS + 1)
WIDTH_NM = (HIGH_NM - LOW_NM) / BANDS
FINE_NM = np.arange(LOW_NM + 0.5, HIGH_NM)
#: Paths that are computed at once.
CHUNK = 8192
#: Paths from which the noise is found.
PATHS = 24 * CHUNK
#: Times of a ray in µs: by compiled code in a small scene, and in a large one.
RAYS_US = (0.3, 10.0)
#: Least probability with which a path goes on.
MIN_SURVIVAL = 0.05
#: Probability with which a fold goes on: near the largest of the surfaces' albedos.
SURVIVAL = 0.8
MEASURED = SHARED / "bispectral/rit_bfc450/PAPYEL.BFC"
DYES = ReradiationMixture(
    25.0,
    np.array([0.7, 0.3]),
    np.array([[430.0, 520.0], [530.0, 580.0]]),
    np.array([[[1600.0, 100.0], [100.0, 400.0]], [[900.0, 0.0], [0.0, 400.0]]]),
)


class Paper:
    """A surface for both methods: as a sampler, and as a matrix of all bands.

    Attributes
    ----------
    shift
        The sampler.
    fold
        Matrix M of the bands, shape (24, 24).
    fine
        The same in bands of 1 nm, shape (480, 480).
    """

    def __init__(self, mixture: ReradiationMixture | None, reflectance: FloatArray) -> None:
        """`reflectance`: in the 24 bands."""
        middles = (EDGES_NM[1:] + EDGES_NM[:-1]) / 2
        plain = ReradiationMatrix.from_bands("paper", middles, middles, np.diag(reflectance))
        if mixture is None:
            self.shift = WavelengthShift(plain, None)
            self.fine = np.diag(np.repeat(reflectance, FINE // BANDS))
        else:
            whole = mixture.to_matrix(middles, middles, reflectance=reflectance)
            self.shift = WavelengthShift(whole, mixture)
            shifted = mixture.reradiation(FINE_NM, FINE_NM[:, np.newaxis])
            # Half of a cell on the diagonal is on the Stokes side.
            shifted += np.diag(0.5 * mixture.scale * mixture.density(FINE_NM, FINE_NM))
            self.fine = np.diag(np.repeat(reflectance, FINE // BANDS)) + shifted
        # Light that is even in a band: outputs are averaged, inputs are summed.
        cells = self.fine.reshape(BANDS, FINE // BANDS, BANDS, FINE // BANDS)
        self.fold = cells.sum(axis=(1, 3)) / (FINE // BANDS)


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A closed room of patches, each of which sees all others alike; patch 0 is seen.

    Attributes
    ----------
    papers, fractions, glow
        The patches' surfaces, parts of the area, and radiance per nm in the 24 bands.
    """

    papers: Sequence[Paper]
    fractions: FloatArray
    glow: FloatArray

    def exact(self) -> FloatArray:
        """Radiance of patch 0 in bands of 1 nm."""
        mean = sum(f * paper.fine for f, paper in zip(self.fractions, self.papers, strict=True))
        glow = np.repeat(self.glow, FINE // BANDS, axis=1)
        inside = np.linalg.solve(np.eye(FINE) - mean, self.fractions @ glow)
        return np.asarray(glow[0] + self.papers[0].fine @ inside)


Draw = Callable[[np.random.Generator, int], tuple[FloatArray, FloatArray, int]]


def single_wavelengths(room: Enclosure, number: int) -> Draw:
    """Return draws of paths that carry `number` rotated wavelengths from the eye."""

    def draw(rng: np.random.Generator, paths: int) -> tuple[FloatArray, FloatArray, int]:
        hero = rng.uniform(LOW_NM, HIGH_NM, paths)
        started = rotated_wavelengths(hero, number, LOW_NM, HIGH_NM)
        radiance = np.zeros_like(started)
        alive, nm, throughput = np.arange(paths), started, np.ones_like(started)
        patch = np.zeros(paths, np.intp)
        vertices = 0
        while alive.size:
            vertices += alive.size
            going_nm, going = np.empty_like(nm), np.empty_like(throughput)
            for which, paper in enumerate(room.papers):
                here = np.flatnonzero(patch == which)
                given = nm[:, here].ravel()
                if room.glow[which].any():
                    band = ((given - LOW_NM) / WIDTH_NM).astype(np.intp).clip(0, BANDS - 1)
                    glow = room.glow[which][band].reshape(number, -1)
                    radiance[:, alive[here]] += throughput[:, here] * glow
                drawn = paper.shift.draw(given, "eye", rng.random((3, given.size)))
                going_nm[:, here] = drawn.wavelength_nm.reshape(number, -1)
                going[:, here] = throughput[:, here] * drawn.weight.reshape(number, -1)
            survival = np.clip(going.mean(axis=0), MIN_SURVIVAL, 1.0)
            goes_on = (rng.random(alive.size) < survival) & (going > 0).any(axis=0)
            alive, nm = alive[goes_on], going_nm[:, goes_on]
            throughput = going[:, goes_on] / survival[goes_on]
            patch = _next_patch(room, rng, alive.size)
        return started, radiance, vertices

    return draw


def folded(room: Enclosure) -> Draw:
    """Return draws of paths without wavelength, folded from their far ends in all bands."""
    matrices = [np.ascontiguousarray(paper.fold.T) / SURVIVAL for paper in room.papers]

    def draw(rng: np.random.Generator, paths: int) -> tuple[FloatArray, FloatArray, int]:
        # The longest first: those that have a vertex d are the first ones.
        lengths = -np.sort(-rng.geometric(1 - SURVIVAL, paths))
        light = np.zeros((paths, BANDS))
        for vertex in range(int(lengths[0]) - 1, -1, -1):
            reaching = int(np.searchsorted(-lengths, -vertex, side="left"))
            patch = _next_patch(room, rng, reaching) if vertex else np.zeros(paths, np.intp)
            for which, matrix in enumerate(matrices):
                here = np.flatnonzero(patch == which)
                light[here] = room.glow[which] + light[here] @ matrix
        return np.zeros((0, paths)), light, int(lengths.sum())

    return draw


def _next_patch(room: Enclosure, rng: np.random.Generator, number: int) -> NDArray[np.intp]:
    if len(room.papers) == 1:
        return np.zeros(number, np.intp)
    return np.searchsorted(np.cumsum(room.fractions)[:-1], rng.random(number), side="right")


@dataclass(frozen=True, eq=False)
class Plane:
    """A paper on the axis of a disk lamp."""

    paper: Paper
    lamp: LampWavelengths
    radius: float = 0.5
    height: float = 1.0

    def exact(self) -> FloatArray:
        """Radiance of the paper in bands of 1 nm."""
        form = self.radius**2 / (self.radius**2 + self.height**2)
        return np.asarray(self.paper.fine @ self.lamp.radiance_at(FINE_NM) * form)

    def factor(self, rng: np.random.Generator, paths: int) -> FloatArray:
        """Geometry of uniform points on the lamp, over π: its mean is R²/(R² + h²)."""
        distance2 = self.radius**2 * rng.random(paths) + self.height**2
        return np.asarray(self.radius**2 * self.height**2 / distance2**2)


def plane_single(plane: Plane, number: int, *, both: bool) -> Draw:
    """Return draws of single wavelengths: shifts from the mixture, or balanced with the lamp."""

    def draw(rng: np.random.Generator, paths: int) -> tuple[FloatArray, FloatArray, int]:
        hero = rng.uniform(LOW_NM, HIGH_NM, paths)
        started = rotated_wavelengths(hero, number, LOW_NM, HIGH_NM)
        given, random = started.ravel(), rng.random((3, started.size))
        shift = plane.paper.shift
        if both:
            light = direct_light(shift, plane.lamp, given, random)
        else:
            drawn = shift.draw(given, "eye", random)
            light = drawn.weight * plane.lamp.radiance_at(drawn.wavelength_nm)
        return started, light.reshape(started.shape) * plane.factor(rng, paths), paths

    return draw


def plane_folded(plane: Plane) -> Draw:
    """Return draws that are folded in all bands."""
    lamp = plane.lamp.radiance_at(FINE_NM).reshape(BANDS, -1).mean(axis=1)
    matrix = plane.paper.fold.T

    def draw(rng: np.random.Generator, paths: int) -> tuple[FloatArray, FloatArray, int]:
        arriving = plane.factor(rng, paths)[:, np.newaxis] * lamp
        return np.zeros((0, paths)), arriving @ matrix, paths

    return draw


@dataclass(frozen=True)
class Found:
    """What a method gives.

    Attributes
    ----------
    light, sigma
        Mean light in the bands and its σ, shape (24,).
    spectrum, luminance
        Standard deviation of one path over the mean light: rms of the bands, and of Y.
    bias
        Error of Y over its σ.
    bias_part
        The same over the exact Y.
    seconds, rays
        Processor time of one path without rays, and their number.
    """

    light: FloatArray
    sigma: FloatArray
    spectrum: float
    luminance: float
    bias: float
    bias_part: float
    seconds: float
    rays: float

    def time_s(self, ray_us: float) -> float:
        """Return the time of one path, with its rays."""
        return self.seconds + 1e-6 * ray_us * self.rays


def measured(draw: Draw, exact: FloatArray, paths: int, seed: int) -> Found:
    """Draw paths and compare them with the exact light in bands of 1 nm."""
    rng = np.random.default_rng(seed)
    eye = observer(CIE_1931)
    fine_y = np.interp(FINE_NM, eye.wavelength_nm, eye.functions[:, 1], 0.0, 0.0)
    band_y = fine_y.reshape(BANDS, -1).mean(axis=1)
    sums, squares, y, taken_s, done, vertices = np.zeros(BANDS), np.zeros(BANDS), [], 0.0, 0, 0
    while done < paths:
        began_s = time.process_time()
        started, light, met = draw(rng, CHUNK)
        taken_s += time.process_time() - began_s
        vertices += met
        done += CHUNK
        if started.size:
            in_bands = np.zeros((CHUNK, BANDS))
            number = len(started)
            band = ((started - LOW_NM) / WIDTH_NM).astype(np.intp).clip(0, BANDS - 1)
            columns = np.broadcast_to(np.arange(CHUNK), started.shape)
            np.add.at(in_bands, (columns, band), light * BANDS / number)
            at = np.interp(started, FINE_NM, fine_y)
            y.append((light * at).mean(axis=0))
        else:
            in_bands = light
            y.append((light * band_y).mean(axis=1))
        sums += in_bands.sum(axis=0)
        squares += (in_bands**2).sum(axis=0)
    mean = sums / done
    variance = squares / done - mean**2
    all_y, exact_y = np.concatenate(y), float((exact * fine_y).mean())
    level = float(exact.mean())
    error = float(all_y.mean()) - exact_y
    return Found(
        mean,
        np.sqrt(variance / done),
        float(np.sqrt(variance.mean())) / level,
        float(all_y.std()) / exact_y,
        error / max(float(all_y.std()) / np.sqrt(done), 1e-15),
        error / exact_y,
        taken_s / done,
        vertices / done,
    )


def furnace(paper: Paper) -> Enclosure:
    """A closed box of one paper that glows."""
    return Enclosure([paper], np.ones(1), np.ones((1, BANDS)))


def sphere(paper: Paper) -> Enclosure:
    """A white sphere with the paper on 40 % and a violet and white lamp on 5 % of its wall."""
    middles = (EDGES_NM[1:] + EDGES_NM[:-1]) / 2
    lamp = np.exp(-0.5 * ((middles - 420) / 25) ** 2) + 0.2
    return Enclosure(
        [paper, Paper(None, np.full(BANDS, 0.8)), Paper(None, np.zeros(BANDS))],
        np.array([0.4, 0.55, 0.05]),
        np.array([np.zeros(BANDS), np.zeros(BANDS), lamp]),
    )


def made_up() -> Paper:
    """A paper with two dyes."""
    return Paper(DYES, np.linspace(0.25, 0.6, BANDS))


def measured_paper() -> Paper:
    """A measured yellow paper, by a mixture of four components and its reflectance."""
    matrix = corrected(read_reradiation(MEASURED))
    reflectance = np.interp(
        (EDGES_NM[1:] + EDGES_NM[:-1]) / 2, matrix.output_nm, matrix.reflectance
    )
    return Paper(fit_mixture(matrix, 4).mixture, reflectance.clip(0.0))


def cases(paper: Paper) -> dict[str, tuple[FloatArray, dict[str, Draw]]]:
    """Return, for each case, the exact light and all methods, the fold first."""
    found: dict[str, tuple[FloatArray, dict[str, Draw]]] = {}
    for name, room in (("furnace", furnace(paper)), ("sphere", sphere(paper))):
        methods: dict[str, Draw] = {"fold, 24 bands": folded(room)}
        for number in (1, 4, 8):
            methods[f"{number} wavelength{'s' * (number > 1)}"] = single_wavelengths(room, number)
        found[name] = (room.exact(), methods)
    narrow = LampWavelengths(np.array([LOW_NM, 450.0, 451.0, HIGH_NM]), np.array([0.0, 480.0, 0.0]))
    even = LampWavelengths(np.array([LOW_NM, HIGH_NM]), np.ones(1))
    for name, lamp in (("plane, even lamp", even), ("plane, lamp of 1 nm", narrow)):
        plane = Plane(paper, lamp)
        methods = {"fold, 24 bands": plane_folded(plane)}
        for number in (1, 4):
            said = f"{number} wavelength{'s' * (number > 1)}"
            methods[said] = plane_single(plane, number, both=False)
            methods[f"{said}, balanced"] = plane_single(plane, number, both=True)
        found[name] = (plane.exact(), methods)
    return found


def row(one: Found, fold: Found) -> str:
    """Return the numbers of a method."""
    root_s = 100 * np.sqrt(one.time_s(RAYS_US[0]))
    text = (
        f"{one.spectrum:9.3f}{one.luminance:9.3f}"
        f"{one.spectrum * root_s:9.4f}{one.luminance * root_s:9.4f}"
    )
    for ray_us in RAYS_US:
        time = one.time_s(ray_us) / fold.time_s(ray_us)
        spectrum = (one.spectrum / fold.spectrum) ** 2 * time
        luminance = (one.luminance / fold.luminance) ** 2 * time
        text += f"{spectrum:10.3g}{luminance:10.3g}"
    return f"{text}{one.bias:+8.1f}{100 * one.bias_part:+8.3f}"


def main() -> None:
    """Print a table for each paper."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--paths", type=int, default=PATHS)
    options = parser.parse_args()
    papers = {"made-up paper, 2 components": made_up}
    if MEASURED.is_file():
        papers["yellow paper as measured, 4 components"] = measured_paper
    for paper_number, (name, make) in enumerate(papers.items()):
        print(f"\n{name}, {options.paths} paths")
        times = "".join(f"{f'× time, {ray_us:g} µs':>20}" for ray_us in RAYS_US)
        print(f"{'':44}{'noise of a path':>18}{'% after 1 s':>18}{times}{'error of Y':>16}")
        short, pair = f"{'spectrum':>9}{'Y':>9}", f"{'spectrum':>10}{'Y':>10}"
        print(f"{'case':20}{'method':24}{2 * short}{2 * pair}"
              f"{'σ':>8}{'%':>8}")  # fmt: skip
        for number, (case, (exact, methods)) in enumerate(cases(make()).items()):
            fold: Found | None = None
            for method_number, (method, draw) in enumerate(methods.items()):
                draw(np.random.default_rng(0), CHUNK)
                seed = 100 * paper_number + 10 * number + method_number
                one = measured(draw, exact, options.paths, seed)
                fold = fold or one
                print(f"{case:20}{method:24}{row(one, fold)}")


if __name__ == "__main__":
    main()
