"""σ of excitation rates where the light is off by more or less than the calibration states.

    python -m tests.acceptance.excitation_light [--seeds 10] [--material NAME ...]

Samples are charged below the simulated filter and by the lamp itself, and analysed as a run of
`excitation` is, with an irradiance file whose errors are drawn. Per case and paint: rms of error
over σ of the rates above 0.002 /s (1 if σ is right), rms error and σ in %, rms of the closure's
deviation over its σ, and the errors of the light as found. At the end of a case: how many fits say
that the exciting bands differ, and rms and range of the light's variance with depth over its σ.
The last case is a layer of optical density 1.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import yaml

from labrig.calibration import IrradianceFile
from labrig.fit.excitation import RelativeSigmas, fit_excitation
from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.material import read_material
from labrig.optics import SLICES, Strip
from labrig.protocols.excitation.analysis.closure import predicted_charging
from labrig.protocols.excitation.analysis.lamp_light import (
    LAMP_SIGMA,
    MAX_FACTOR,
    light_scatter,
    mode_kinds,
    scale_sigma,
    site_modes,
)
from labrig.protocols.excitation.result import LightScatter, PatchCharging
from labrig.results import BandTests, ChargingSeries, FittedExcitation, Series
from labrig.sim.bench_settings import LvfSettings
from labrig.sim.lamp import WAVELENGTH_NM
from labrig.sim.layout import Lvf
from tests.fit.charged_samples import Bench
from tests.fit.layers import Layer

PAINTS = ("blue-paint", "white-paint", "orange-paint", "pink-paint", "purple-paint", "red-paint")
#: What the calibration states, and draws.
STATED = 0.005
POSITION = (np.arange(SLICES) + 0.5) / SLICES
#: Length of the filter in nm, and distance at which smooth errors are independent.
LENGTH_NM, SMOOTH_NM = 300.0, 60.0
CHARGES_S, DIRECT_S = (8, 16, 32, 64, 128, 256, 256, 8), (3, 10, 60, 900)
DARK = (0.01, 0.01, 0.01)
STRONG_PER_S = 0.002


@dataclass(frozen=True)
class Case:
    """Errors of the light beyond those stated: of places, of the lamp; and the kind of bench."""

    name: str
    sites: float = 0.0
    nm: float = 0.0
    lamp: float = 0.003
    bench: type[Bench] = Bench


CASES = (
    Case("as stated"),
    Case("places 3 %", sites=0.03),
    Case("wavelengths 1 nm", nm=1.0),
    Case("lamp 1 %", lamp=0.01),
    Case("layer of optical density 1", bench=Layer),
)


def windows() -> FloatArray:
    """(P, wavelengths) transmittance at the places of the shipped rig's filter."""
    content = yaml.safe_load((resources.folder("config") / "sim-phosphor.yaml").read_text())
    settings = LvfSettings.model_validate(content["simulation"]["lvf"])
    return Lvf(settings).transmission(POSITION)


def irradiance_file(bench: Bench, case: Case, rng: np.random.Generator) -> IrradianceFile:
    """The light on all places, off as the case has it."""
    bands_nm = bench.material.bands_nm
    assert bands_nm is not None
    through = bench.irradiances(windows())
    direct = bench.irradiances(np.ones((1, len(WAVELENGTH_NM))))[0]
    distance = (POSITION[:, None] - POSITION) * LENGTH_NM / SMOOTH_NM
    smooth = np.linalg.cholesky(np.exp(-(distance**2) / 2) + 1e-6 * np.eye(SLICES))
    light = np.log(np.maximum(through, 1e-6 * through.max()))
    slope_per_nm = np.gradient(light, POSITION * LENGTH_NM, axis=0)
    off = STATED * smooth @ rng.normal(size=SLICES) + case.sites * rng.normal(size=SLICES)
    shift_nm = case.nm * smooth @ rng.normal(size=SLICES)
    through = through * np.exp(off[:, None] + shift_nm[:, None] * slope_per_nm)
    ratio = direct.sum() / through.sum(axis=1)
    return IrradianceFile(
        lamp="drawn",
        bands_nm=bands_nm,
        vector_length=float(np.linalg.norm(direct)),
        direct=tuple(direct.tolist()),
        direct_sigma=(0.0,) * len(direct),
        position=tuple(POSITION.tolist()),
        through=tuple(map(tuple, through.tolist())),
        through_sigma=tuple(map(tuple, (STATED * through).tolist())),
        scale_sigma=STATED,
        ratio=tuple(ratio.tolist()),
        ratio_sigma=tuple((STATED * ratio).tolist()),
        strip=Strip(left=(0.08, 0.5), right=(0.92, 0.5), height=0.3, rising=True),
    )


def charging(bench: Bench, case: Case, file: IrradianceFile) -> PatchCharging:
    """Charges through the filter and by the lamp itself."""
    everywhere = np.tile(file.direct, (SLICES, 1))

    def lamp_off(series: ChargingSeries) -> ChargingSeries:
        charges = tuple(
            replace(one, brightness=one.brightness * float(np.exp(case.lamp * error)))
            for one, error in zip(
                series.charges, bench.random.normal(size=len(series.charges)), strict=True
            )
        )
        return replace(series, charges=charges)

    through = bench.series("through the filter", windows(), CHARGES_S, 200.0, 9, 9.0, 1.0)
    bare = np.ones((SLICES, len(WAVELENGTH_NM)))
    direct = bench.series("by the lamp itself", bare, DIRECT_S, 200.0, 9, 9.0, 1.0)
    through = replace(
        lamp_off(through),
        irradiance=np.array(file.through),
        site_modes=site_modes(file),
        mode_kind=mode_kinds(file),
    )
    one, three = np.ones(1), np.ones((1, 3))
    whole = Series(
        one, one, three, three, np.array(DARK), ("R", "G", "B"), one, one, ("",), ("",), ("",)
    )
    return PatchCharging(
        through, replace(lamp_off(direct), irradiance=everywhere), np.ones(SLICES), whole
    )


def fitted(
    bench: Bench, sigmas: RelativeSigmas, found: PatchCharging, near: FittedExcitation | None = None
) -> FittedExcitation:
    """The fit of a run's analysis, its start values from the truth."""
    rates = [state.k_r_per_s for state in bench.material.states]
    return fit_excitation([found.through, found.direct], rates, bench.amplitudes(), sigmas, near)


class Outcome(NamedTuple):
    """Rates of a fit: (b,) error, σ and truth above the limit, deviations of the closure in σ."""

    off: FloatArray
    sigma: FloatArray
    truth: FloatArray
    closure: FloatArray
    light: LightScatter
    tests: BandTests


def measured(case: Case, material: str, seed: int) -> Outcome:
    """One sample and its fit."""
    bench = case.bench(read_material(material), flicker=0.007, photons=5.0, seed=seed)
    file = irradiance_file(bench, case, np.random.default_rng([seed, 1]))
    series = charging(bench, case, file)
    sigmas = RelativeSigmas(
        flicker=bench.flicker, lamp=LAMP_SIGMA, cold_deficit=0.005, offset=DARK,
        common_mode=DARK, scale=scale_sigma(file), largest_factor=MAX_FACTOR,
    )  # fmt: skip
    fit = fitted(bench, sigmas, series)
    closure = predicted_charging(series, sigmas, lambda one: fitted(bench, sigmas, one, fit))
    assert closure is not None
    assert fit.by_band is not None
    truth = np.array([state.k_e_per_s for state in bench.material.states])
    sigma = np.array([state.k_e_per_s_sigma for state in fit.states])
    strong = truth >= STRONG_PER_S
    return Outcome(
        (fit.k_e() - truth)[strong],
        sigma[strong],
        truth[strong],
        (closure.measured - closure.predicted) / closure.sigma,
        light_scatter(fit),
        fit.by_band,
    )


def differ(tests: BandTests) -> bool:
    """Return whether any test says that bands excite different glows."""
    quantities = (tests.amplitude, tests.rate, tests.hue)
    return tests.is_thick or any(one is not None and one.differs for one in quantities)


def line(outcomes: Sequence[Outcome]) -> str:
    """Return the figures of a paint."""
    lamp, nm, sites = np.mean(
        [
            [one.light.lamp, one.light.wavelength_nm or 0.0, one.light.sites or 0.0]
            for one in outcomes
        ],
        axis=0,
    )
    return (
        f"pulls {_rms([one.off / one.sigma for one in outcomes]):5.2f}  "
        f"error {100 * _rms([one.off / one.truth for one in outcomes]):5.2f} %  "
        f"σ {100 * _rms([one.sigma / one.truth for one in outcomes]):5.2f} %  "
        f"closure {_rms([one.closure for one in outcomes]):5.2f} σ  "
        f"found: lamp {100 * lamp:.2f} %, {nm:.2f} nm, places {100 * sites:.2f} %"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--material", nargs="*", default=PAINTS)
    asked = parser.parse_args()
    for case in CASES:
        every: list[Outcome] = []
        for number, material in enumerate(asked.material):
            seeds = range(1000 * number, 1000 * number + asked.seeds)
            outcomes = [measured(case, material, seed) for seed in seeds]
            print(f"{case.name:27}{material:14} {line(outcomes)}", flush=True)
            every += outcomes
        variances = [one.tests.light_variance for one in every]
        depth = np.array([variance.value / variance.sigma for variance in variances])
        print(
            f"{case.name}: pulls {_rms([one.off / one.sigma for one in every]):.2f}; "
            f"{sum(differ(one.tests) for one in every)} of {len(every)} say that bands differ; "
            f"variance with depth {_rms([depth]):.2f} σ rms, {depth.min():+.1f} to "
            f"{depth.max():+.1f} σ",
            flush=True,
        )


def _rms(parts: Sequence[FloatArray]) -> float:
    return float(np.sqrt(np.mean(np.square(np.concatenate(parts)))))


if __name__ == "__main__":
    main()
