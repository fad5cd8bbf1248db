"""Whether charging saturated a sample, and whether its rates depend on the charge."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from scipy.special import chdtrc, fdtrc

from labrig.results.fitted_decay import FittedDecay
from labrig.results.measured import FloatArray, Measured
from labrig.results.run_result import RunResult
from labrig.results.text_files import write_csv

#: Lights of a saturation run, as its units are called.
LIGHTS = FULL_LIGHT, WEAKER = "full", "weaker"
#: r(0) = 1 may be believed from here on, and not below.
NEARLY_ONE = 0.95
#: Where a longer charge brightens the glow by less, the plateau is reached.
PLATEAU = 0.02
SIGMAS = 2.0
#: Chance at which rates that are the same are said to differ.
LEVEL = 1e-3
#: Chance at which decays that are exponentials are said to be none.
MISFIT_LEVEL = 5e-4


@dataclass(frozen=True)
class ChargeLevel:
    """r of a state at lamp off after the longest charge under the full light, and its σ."""

    r: float
    sigma: float

    @property
    def assessment(self) -> Literal["yes", "no", "not decided"]:
        """Whether r(0) = 1 may be believed."""
        if self.r + SIGMAS * self.sigma < NEARLY_ONE:
            return "no"
        return "yes" if self.r - SIGMAS * self.sigma > NEARLY_ONE else "not decided"


@dataclass(frozen=True, eq=False)
class Curve:
    """One decay, its channels as one.

    Attributes
    ----------
    t_s, exposure_s
        (n,) begins of the exposures after lamp off, and their lengths.
    value, sigma
        (n,) DN/s of the brightest channel, flicker in σ.
    offset_sigma
        σ of a constant that may be in all values.
    """

    t_s: FloatArray
    exposure_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    offset_sigma: float


@dataclass(frozen=True, eq=False)
class RatesTest:
    """What sharing the rates of s states costs d decays.

    Attributes
    ----------
    shared_per_s
        (s,) by falling rate.
    own_per_s, own_sigma_per_s
        (d, s) of every decay by itself.
    amplitude, amplitude_sigma
        (d, s) of every decay at lamp off, the rates shared.
    residuals
        Of every decay (n,), value − model in σ, the rates shared.
    chi2_shared, chi2_own, dof_own
        Sums of all decays.
    noise_dof
        Degrees of freedom from which the noise itself was estimated; infinite if it is known.
    p_value
        Of an F-test: chance that rates which are the same come out so different.
    """

    shared_per_s: FloatArray
    own_per_s: FloatArray
    own_sigma_per_s: FloatArray
    amplitude: FloatArray
    amplitude_sigma: FloatArray
    residuals: tuple[FloatArray, ...]
    chi2_shared: float
    chi2_own: float
    dof_own: int
    noise_dof: float
    p_value: float

    @property
    def differ(self) -> bool:
        """Whether the rates depend on the charge."""
        return self.p_value < LEVEL

    @property
    def misfit(self) -> bool:
        """Whether not even rates of their own describe the decays."""
        if np.isinf(self.noise_dof):
            return float(chdtrc(self.dof_own, self.chi2_own)) < MISFIT_LEVEL
        excess = self.chi2_own / self.dof_own
        return float(fdtrc(self.dof_own, self.noise_dof, excess)) < MISFIT_LEVEL


@dataclass(frozen=True, eq=False)
class PatchSaturation:
    """What the decays of a patch say.

    Attributes
    ----------
    fit
        Of the decay after the longest charge under the full light.
    light, charge_s
        Of every decay, in the order of `curves`: `full` or `weaker`, and how long the lamp shone.
    curves
        All decays by their unit.
    rates
        What sharing the rates costs them.
    growth_at_begin, growth_at_end
        Of the glow between the last two charges under the full light, as a fraction, at the begin
        and at the end of their decays, where slow states show.
    levels
        Of every state by falling rate; none without a weaker light.
    """

    fit: FittedDecay
    light: tuple[str, ...]
    charge_s: FloatArray
    curves: Mapping[str, Curve]
    rates: RatesTest
    growth_at_begin: Measured
    growth_at_end: Measured
    levels: tuple[ChargeLevel, ...]

    @property
    def in_time(self) -> Literal["saturated in time", "not saturated", "not decided"]:
        """Whether a longer charge still brightens the glow."""
        growths = self.growth_at_begin, self.growth_at_end
        if any(one.value - SIGMAS * one.sigma > PLATEAU for one in growths):
            return "not saturated"
        if all(one.value + SIGMAS * one.sigma < 2 * PLATEAU for one in growths):
            return "saturated in time"
        return "not decided"

    def rows(self, light: str) -> list[int]:
        """Numbers of the decays under that light, by their charge."""
        return [row for row, one in enumerate(self.light) if one == light]


@dataclass(frozen=True, eq=False, kw_only=True)
class SaturationResult(RunResult):
    """Plateaus, levels of charge, and rates over the charge.

    Attributes
    ----------
    patches
        By name.
    weaker_light
        Over the full one; None if there was none.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for patch in result.patches.values():
    ...     print(patch.rates.shared_per_s, patch.rates.p_value, patch.growth_at_begin.value)
    """

    kind: ClassVar[str] = "saturation"

    patches: Mapping[str, PatchSaturation]
    weaker_light: Measured | None

    def write_files(self, folder: Path) -> None:
        """Write `saturation.csv`."""
        head = ("patch", "light", "charge_s", "k_r_per_s", "amplitude", "amplitude_sigma")
        rows = []
        for name, patch in self.patches.items():
            rates = patch.rates
            for light in LIGHTS:
                for row in patch.rows(light):
                    of_states = zip(
                        rates.shared_per_s,
                        rates.amplitude[row],
                        rates.amplitude_sigma[row],
                        strict=True,
                    )
                    for numbers in of_states:
                        texts = (f"{number:.6g}" for number in (patch.charge_s[row], *numbers))
                        rows.append((name, light, *texts))
        write_csv(folder / "saturation.csv", head, rows)
