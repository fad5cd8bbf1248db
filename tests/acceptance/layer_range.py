"""The range that thickness leaves k_e and Λ, against layers whose rates are known.

    python -m tests.acceptance.layer_range [--seeds 10] [--drawn 60] [--thin 20]

Samples are charged, fitted as surfaces and looked at as layers, as a run of `excitation` does:

- the layers of optical density 1 of `excitation_light`, the same seeds;
- held-out layers of optical density 0 to 2, a fifth of them thin, of seven materials, under three
  lamps, photographed with much and little noise. They absorb as they excite, alike in all bands,
  half as each, by a host up to 470 nm, or by a pigment about 540 nm, too: half and pigment are none
  of the courses that are tried;
- thin layers of optical density up to 0.05 whose reflectance 10^(−D) is measured within 0.005.

Per group: rates above 0.002 /s and Λ within 2 σ of the fit (before), and within the range widened
by 2 σ (after); median and largest ratio of the range's ends for k_e.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from labrig.calibration import PatchReflectance
from labrig.fit.excitation import RelativeSigmas, layer_effect
from labrig.foundation.arrays import FloatArray
from labrig.material import read_material
from labrig.protocols.excitation.analysis.lamp_light import LAMP_SIGMA, MAX_FACTOR, scale_sigma
from labrig.protocols.excitation.analysis.material import largest_density
from labrig.sim.lamp import WAVELENGTH_NM, Lamp
from labrig.sim.phosphor import phosphor
from tests.acceptance.excitation_light import (
    DARK,
    PAINTS,
    STRONG_PER_S,
    Case,
    charging,
    fitted,
    irradiance_file,
)
from tests.fit.charged_samples import Bench, two_states
from tests.fit.layers import Layer

COURSES = ("as excitation", "half", "grey", "host", "pigment")
DEPTHS = 24
#: Standard deviations by which ranges are widened.
SIGMAS = 2.0


class Deep(Bench):
    """A layer of an optical density and a course of absorption from band to band."""

    optical_density = 1.0
    course = COURSES[0]

    def _glow(self, windows: FloatArray, lamp: Lamp, charges: Any) -> FloatArray:
        absorbed = phosphor([self.material], [None], self.irradiance).excitation.sum(axis=0)
        absorbed = absorbed / absorbed.max()
        nm = WAVELENGTH_NM
        if self.course == "grey":
            absorbed = np.ones_like(absorbed)
        if self.course == "half":
            absorbed = (absorbed + 1) / 2
        if self.course == "host":
            absorbed = np.maximum(absorbed, 1 / (1 + np.exp((nm - 470) / 15)))
        if self.course == "pigment":
            absorbed = np.clip(absorbed + 0.7 * np.exp(-(((nm - 540) / 50) ** 2)), 0, 1)
        depth = (np.arange(DEPTHS) + 0.5) / DEPTHS
        passed = 10.0 ** (-self.optical_density * np.outer(depth, absorbed))
        each = (windows[:, None, :] * passed).reshape(-1, windows.shape[1])
        glow = super()._glow(each, lamp, charges)
        mean: FloatArray = glow.reshape(len(glow), len(windows), -1).mean(axis=2)
        return mean


class Outcome(NamedTuple):
    """Each k_e and Λ: is it within σ of the fit, within the range? And the ratio of its ends."""

    k_e_before: FloatArray
    k_e: FloatArray
    whole_before: FloatArray
    whole: FloatArray
    ratio: FloatArray


def outcome(bench: Bench, seed: int, reflectance: PatchReflectance | None = None) -> Outcome:
    """One sample, its fit and its range."""
    case = Case("layer")
    file = irradiance_file(bench, case, np.random.default_rng([seed, 1]))
    series = charging(bench, case, file)
    sigmas = RelativeSigmas(
        flicker=bench.flicker, lamp=LAMP_SIGMA, cold_deficit=0.005, offset=DARK,
        common_mode=DARK, scale=scale_sigma(file), largest_factor=MAX_FACTOR,
    )  # fmt: skip
    fit = fitted(bench, sigmas, series)
    limit, basis = largest_density(file.bands_nm, None, reflectance)
    layer = layer_effect([series.through, series.direct], fit, sigmas, limit, basis)
    fit = replace(fit, layer=layer)
    k_r = np.array([state.k_r_per_s for state in bench.material.states])
    falling = np.argsort(-k_r)
    truth = np.array([state.k_e_per_s for state in bench.material.states])[falling]
    whole_truth = (bench.amplitudes() / k_r)[falling]
    k_e, sigma = fit.k_e(), np.array([state.k_e_per_s_sigma for state in fit.states])
    strong = (truth >= STRONG_PER_S) & np.array([state.seen for state in fit.states])
    room = SIGMAS * sigma * layer.k_e_factor
    low, high = k_e * layer.k_e_factor[0] - room[0], k_e * layer.k_e_factor[1] + room[1]
    whole = np.array([state.amplitude / state.k_r_per_s for state in fit.states])
    part = SIGMAS * np.array([state.amplitude_sigma / state.amplitude for state in fit.states])
    ends = layer.reradiation_factor * whole * np.stack([1 - part, 1 + part])
    return Outcome(
        (np.abs(truth - k_e) <= SIGMAS * sigma)[strong],
        ((low <= truth) & (truth <= high))[strong],
        np.abs(whole_truth / whole - 1) <= part,
        (ends[0] <= whole_truth) & (whole_truth <= ends[1]),
        (layer.k_e_factor[1] / layer.k_e_factor[0])[strong],
    )


def validated(seeds: int) -> Iterator[Outcome]:
    """Layers of optical density 1, with the seeds of `excitation_light`."""
    for number, paint in enumerate(PAINTS):
        for seed in range(1000 * number, 1000 * number + seeds):
            bench = Layer(read_material(paint), flicker=0.007, photons=5.0, seed=seed)
            yield outcome(bench, seed)


def held_out(number: int, course: str, random: np.random.Generator) -> Outcome:
    """A layer that is drawn."""
    material = two_states() if number % 7 == 6 else read_material(PAINTS[number % 7])
    photons, flicker = ((5.0, 0.007), (100.0, 0.003), (20.0, 0.005))[random.integers(3)]
    seed = 20000 + number
    bench = Deep(
        material,
        irradiance=(4.0, 1.0, 12.0)[random.integers(3)],
        flicker=flicker,
        photons=photons,
        seed=seed,
    )
    bench.course = course
    bench.optical_density = 0.0 if number % 5 == 4 else random.uniform(0.0, 2.0)
    return outcome(bench, seed)


def thin(number: int, random: np.random.Generator) -> Outcome:
    """A thin layer whose reflectance was measured."""
    seed = 30000 + number
    bench = Deep(read_material(PAINTS[number % 6]), flicker=0.007, photons=5.0, seed=seed)
    bench.course, bench.optical_density = "grey", random.uniform(0.0, 0.05)
    nm = tuple(np.linspace(405.0, 695.0, 30))
    albedo = np.clip(10.0**-bench.optical_density + 0.005 * random.normal(size=30), 0.0, 1.2)
    error = (0.005,) * 30
    columns = tuple(albedo.tolist())
    return outcome(
        bench,
        seed,
        PatchReflectance(
            wavelength_nm=nm,
            albedo=columns,
            albedo_sigma=error,
            radiance_factor=columns,
            radiance_factor_sigma=error,
            common_sigma=0.0,
        ),
    )


def line(name: str, outcomes: list[Outcome]) -> str:
    """Return the figures of a group."""
    parts = [np.concatenate(values) for values in zip(*outcomes, strict=True)]
    k_e_before, k_e, whole_before, whole = (100 * np.mean(part) for part in parts[:4])
    return (
        f"{name:34} {len(outcomes):3} layers: of {len(parts[0]):3} k_e {k_e_before:3.0f} % within "
        f"2 σ of the fit, {k_e:3.0f} % within the range; of {len(parts[2]):2} Λ "
        f"{whole_before:3.0f} % and {whole:3.0f} %; largest over least k_e "
        f"{np.median(parts[4]):.2f}, at most {parts[4].max():.2f}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--drawn", type=int, default=60)
    parser.add_argument("--thin", type=int, default=20)
    asked = parser.parse_args()
    print(line("optical density 1, as validated", list(validated(asked.seeds))), flush=True)
    every: list[Outcome] = []
    for first, course in enumerate(COURSES):
        numbers = range(first, asked.drawn, len(COURSES))
        outcomes = [held_out(n, course, np.random.default_rng([7, n])) for n in numbers]
        every += outcomes
        print(line(f"held out, absorbing: {course}", outcomes), flush=True)
    print(line("held out, all", every), flush=True)
    outcomes = [thin(n, np.random.default_rng([8, n])) for n in range(asked.thin)]
    print(line("thin by reflectance", outcomes), flush=True)


if __name__ == "__main__":
    main()
