"""Result of a saturation run: whether charging saturates, and whether rates depend on it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy.special import chdtrc, fdtrc

from labrig.foundation.arrays import FloatArray
from labrig.foundation.notebook_views import CsvTable
from labrig.results.budget import Budget, named
from labrig.results.fitted_decay import FittedDecay
from labrig.results.fitted_excitation import THICKNESS
from labrig.results.fitted_law import EXPONENTIALS
from labrig.results.measured import Measured
from labrig.results.run_result import RunResult

#: Names of the lights of a saturation run, as in its units.
LIGHTS = FULL_LIGHT, WEAKER = "full", "weaker"
#: Level r(0) from which a state counts as fully charged.
NEARLY_ONE = 0.95
#: Relative growth of the glow by a longer charge below which the plateau is reached.
PLATEAU = 0.02
SIGMAS = 2.0
#: Significance level of the test for different rates.
LEVEL = 1e-3
#: Differences in σ from which a kinetic order shows, and largest σ of the shift's exponent with
#: which its absence is told.
ORDER_SIGMAS, MAX_SHIFT_SIGMA = 3.0, 0.1
#: Significance level of the test for decays that are not exponential.
MISFIT_LEVEL = 5e-4


@dataclass(frozen=True)
class Concentration:
    """Level of a state at lamp off after the longest charge under the full light.

    Attributes
    ----------
    r
        Level, 1 if fully charged.
    sigma
        Its standard uncertainty.
    """

    r: float
    sigma: float

    @property
    def assessment(self) -> Literal["yes", "no", "not decided"]:
        """Whether r(0) = 1 is compatible with the level."""
        if self.r + SIGMAS * self.sigma < NEARLY_ONE:
            return "no"
        return "yes" if self.r - SIGMAS * self.sigma > NEARLY_ONE else "not decided"


@dataclass(frozen=True, eq=False)
class Curve:
    """One decay, its channels combined.

    Attributes
    ----------
    t_s, exposure_s
        Begins of the exposures in seconds after lamp off, and exposure times in seconds, shape
        (n,).
    value, sigma
        Signal of the brightest channel and its standard uncertainty with flicker in DN/s, shape
        (n,).
    offset_sigma
        Standard uncertainty of a constant offset common to all values in DN/s.
    """

    t_s: FloatArray
    exposure_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    offset_sigma: float


@dataclass(frozen=True, eq=False)
class RatesTest:
    """Test whether d decays of s states share their rates.

    Attributes
    ----------
    shared_per_s
        Shared rates in 1/s, falling, shape (s,).
    own_per_s, own_sigma_per_s
        Rates of every decay alone and their standard uncertainties in 1/s, shape (d, s); NaN and
        infinite of a state that the decay lacks.
    amplitude, amplitude_sigma
        Amplitudes of every decay at lamp off with shared rates in DN/s, shape (d, s).
    residuals
        Value − model of every decay in σ with shared rates, shape (n,) each.
    chi2_shared, chi2_own
        χ² of all decays with shared and with own rates.
    dof_own
        Degrees of freedom with own rates.
    noise_dof
        Degrees of freedom from which the noise itself was estimated; infinite if it is known.
    p_value
        p-value of the F-test: probability of such different rates if the true ones are equal.
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
        """Whether not even individual rates describe the decays."""
        if np.isinf(self.noise_dof):
            return float(chdtrc(self.dof_own, self.chi2_own)) < MISFIT_LEVEL
        excess = self.chi2_own / self.dof_own
        return float(fdtrc(self.dof_own, self.noise_dof, excess)) < MISFIT_LEVEL


@dataclass(frozen=True, eq=False)
class OrderTest:
    """Test of a kinetic order by decays after several charges, each (1 + u R t)^(−1/u).

    Attributes
    ----------
    light
        Signal of every decay at lamp off in DN/s, shape (d,).
    rate_per_s, rate_per_s_sigma
        Relative fall R of the signal at lamp off and its standard uncertainty in 1/s, shape (d,).
    shape
        Exponent u of the common shape, 0 of an exponential; (b − 1)/b of a state of order b.
    shift
        Exponent v of R ∝ lightᵛ: 0 where the rate does not depend on the charge, u of a state.
    difference_sigma
        Standard uncertainty of u − v.
    chi2, dof
        χ² and degrees of freedom; where χ² is larger all σ are enlarged by the root of their ratio.
    """

    light: FloatArray
    rate_per_s: FloatArray
    rate_per_s_sigma: FloatArray
    shape: Measured
    shift: Measured
    difference_sigma: float
    chi2: float
    dof: int

    @property
    def reduced_chi2(self) -> float:
        """χ² per degree of freedom."""
        return self.chi2 / self.dof

    @property
    def verdict(self) -> Literal["first order", "general order", "neither", "not decided"]:
        """Verdict of the rates at lamp off."""
        if self.shift.sigma > MAX_SHIFT_SIGMA:
            return "not decided"
        if abs(self.shift.value) < ORDER_SIGMAS * self.shift.sigma:
            return "first order"
        is_alike = abs(self.shape.value - self.shift.value) < ORDER_SIGMAS * self.difference_sigma
        return "general order" if is_alike else "neither"

    @property
    def order(self) -> Measured:
        """Kinetic order b = 1/(1 − v) by the shift."""
        kept = 1 - self.shift.value
        return Measured(1 / kept, self.shift.sigma / kept**2)


@dataclass(frozen=True, eq=False)
class PatchSaturation:
    """Saturation of a patch.

    Attributes
    ----------
    fit
        Fit of the decay after the longest charge under the full light.
    light, charge_s
        Light of every decay, `full` or `weaker`, and duration of its charge in seconds, in the
        order of `curves`.
    curves
        All decays by their unit.
    rates
        Test of shared rates.
    growth_at_begin, growth_at_end
        Relative growth of the glow between the last two charges under the full light, at the start
        and at the end of their decays, where slow states dominate.
    levels
        Level of every state by falling rate; empty without a weaker light.
    order
        Test of a kinetic order; None where the decays do not allow it.
    """

    fit: FittedDecay
    light: tuple[str, ...]
    charge_s: FloatArray
    curves: Mapping[str, Curve]
    rates: RatesTest
    growth_at_begin: Measured
    growth_at_end: Measured
    levels: tuple[Concentration, ...]
    order: OrderTest | None = None

    @property
    def time_saturation(self) -> Literal["saturated in time", "not saturated", "not decided"]:
        """Whether a longer charge still brightens the glow."""
        growths = self.growth_at_begin, self.growth_at_end
        if any(growth.value - SIGMAS * growth.sigma > PLATEAU for growth in growths):
            return "not saturated"
        if all(growth.value + SIGMAS * growth.sigma < 2 * PLATEAU for growth in growths):
            return "saturated in time"
        return "not decided"

    @property
    def is_of_general_order(self) -> bool:
        """Whether a state of a kinetic order describes all decays better than states of the first.

        Several states of first order that charges fill unequally make the rate at lamp off shift
        with the charge, too, now and then as their shape would have it. Where exponentials describe
        the longest charge's decay, the two models are compared by the Bayesian information
        criterion: a rate and a light of each decay and one shape, against shared rates and
        amplitudes of each decay.
        """
        if self.order is None or self.order.verdict != "general order":
            return False
        if self.fit.law != EXPONENTIALS:
            return True
        decays, states = self.rates.amplitude.shape
        frames = sum(len(curve.t_s) for curve in self.curves.values())
        added = states * (decays + 1) - (2 * decays + 1)
        return bool(self.order.chi2 < self.rates.chi2_shared + added * np.log(frames))

    @property
    def is_of_no_law(self) -> bool:
        """Whether neither states of first order nor one of another order describe all decays.

        Several states of first order that are filled unequally look like no order either; they
        describe the decays with the same rates after every charge.
        """
        if self.order is None or self.order.verdict != "neither":
            return False
        return self.fit.n_states == 1 or self.rates.differ or self.rates.misfit

    def rows(self, light: str) -> list[int]:
        """Return the numbers of the decays under a light, in the order of `curves`."""
        return [row for row, decay_light in enumerate(self.light) if decay_light == light]


@dataclass(frozen=True, eq=False, kw_only=True)
class SaturationResult(RunResult):
    """Plateaus, levels of charge, and rates over the charge.

    Attributes
    ----------
    patches
        Saturation of each patch by its name.
    weaker_light
        Weaker light relative to the full one; None if there was none.

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for patch in result.patches.values():
    ...     print(patch.rates.shared_per_s, patch.rates.p_value, patch.growth_at_begin.value)
    """

    kind: ClassVar[str] = "saturation"

    patches: Mapping[str, PatchSaturation]
    weaker_light: Measured | None

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of the levels of charge.

        In the depth of a thick sample the level is lower, which the glow hardly shows.
        """
        return {
            named(name, f"r(0) of state {number}"): Budget.of(
                Measured(level.r, level.sigma), left_out=(THICKNESS,)
            )
            for name, patch in self.patches.items()
            for number, level in enumerate(patch.levels, start=1)
        }

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the table `saturation.csv`."""
        head = ("patch", "light", "charge_s", "k_r_per_s", "amplitude", "amplitude_sigma")
        rows = []
        for name, patch in self.patches.items():
            rates = patch.rates
            for light in LIGHTS:
                for row in patch.rows(light):
                    state_values = zip(
                        rates.shared_per_s,
                        rates.amplitude[row],
                        rates.amplitude_sigma[row],
                        strict=True,
                    )
                    for numbers in state_values:
                        texts = (f"{number:.6g}" for number in (patch.charge_s[row], *numbers))
                        rows.append((name, light, *texts))
        return {"saturation.csv": CsvTable(head, rows)}
