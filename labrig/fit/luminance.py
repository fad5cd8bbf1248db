"""Luminance of an afterglow at given times, from readings around them.

No law of decay is assumed: around each time ln L is a parabola in ln t, which every law is within a
factor of some tenths in time. Only the forecast beyond the last reading rests on laws.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import chdtrc

from labrig.fit.crossing import forecast_crossing
from labrig.fit.nonlinear_least_squares import least_squares
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.quantity import duration_text
from labrig.foundation.result_warning import Disturbance, ResultWarning, Undetermined
from labrig.results import (
    MARKING_S,
    NORMAL_95,
    TABLE_S,
    VISIBLE_MCD_PER_M2,
    ForecastTime,
    LuminanceAt,
    LuminanceDecay,
    LuminanceRequirement,
    Measured,
)

UNIT = "mcd/m²"
#: Fewest readings of a parabola, where their σ is known and where their scatter tells it.
FEWEST, MIN_WITHOUT_SIGMA = 5, 8
#: Range of ln t of a parabola to each side, at least, and at most where readings are few.
NEAR, FAR = math.log(1.5), math.log(8.0)
#: Significance from which the end falls too slowly, the factor in time between the luminances that
#: tell it, and the luminance below which a meter's zero may do that.
SLOWER_SIGMAS, EARLIER, DIM_MCD_PER_M2 = 4.0, 4.0, 3.0
#: Slope of ln L in ln t from which a time has an error of its own.
MIN_SLOPE = 1e-3
#: σ of normal errors over the median of their sizes.
MEDIAN_TO_SIGMA = 1.4826
#: Probability of χ² below which a parabola misses the readings.
MISSED = 0.05


def fit_luminance(
    t_s: ArrayLike,
    luminance_mcd_per_m2: ArrayLike,
    luminance_mcd_per_m2_sigma: ArrayLike | None = None,
    *,
    scale_sigma: ArrayLike = 0.0,
    required: Sequence[LuminanceRequirement] = (),
    colours: str = "",
    excitation: str = "",
    origin: str = "",
) -> LuminanceDecay:
    """Find what trade standards ask of an afterglow from readings of a luminance meter.

    Parameters
    ----------
    t_s
        Times of the readings after lamp off in seconds, rising, > 0, shape (n,).
    luminance_mcd_per_m2
        Luminances in mcd/m²; those in the noise may be negative, shape (n,).
    luminance_mcd_per_m2_sigma
        Standard uncertainty of each reading, shape (n,) or a scalar; None takes it from the
        scatter of neighbours.
    scale_sigma
        Relative σ of errors that neighbouring readings have in common: of the scale for all, a
        scalar, or with what comes on top later, such as that of a zero, shape (n,).
    required
        Least luminances at some times.
    colours, excitation, origin
        Letters for the marking, the excitation as the report shall state it, and the file or run
        with the readings.

    Returns
    -------
    LuminanceDecay
        Luminances at 2, 10, 30 and 60 min, the time until 0.3 mcd/m² and what follows from them.

    Raises
    ------
    FitError
        There are fewer than five readings, eight without σ, times do not rise from above zero,
        values are not finite, or no luminance is above zero.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_luminance
    >>> t_s = np.geomspace(60, 40_000, 80)
    >>> light = 300 * (1 + t_s / 60) ** -1.1
    >>> light = light * (1 + 0.01 * np.random.default_rng(1).standard_normal(80))
    >>> found = fit_luminance(t_s, light, 0.01 * light, scale_sigma=0.03, colours="K-W")
    >>> found.marking
    '21.5/3.27-532-K-W'
    """
    readings = _Readings.checked(t_s, luminance_mcd_per_m2, luminance_mcd_per_m2_sigma, scale_sigma)
    visible_s = readings.falls_below(VISIBLE_MCD_PER_M2)
    at = {t: readings.luminance_at(t) for t in TABLE_S}
    forecast, warnings = (None, ()) if visible_s else readings.forecast(VISIBLE_MCD_PER_M2)
    return LuminanceDecay(
        t_s=readings.t_s,
        luminance_mcd_per_m2=readings.value,
        luminance_mcd_per_m2_sigma=np.full_like(readings.t_s, np.nan)
        if readings.sigma is None
        else readings.sigma,
        scale_sigma=float(readings.scale_sigma.max()),
        at=tuple(LuminanceAt(t, value) for t, value in at.items()),
        required=tuple(
            (each, LuminanceAt(each.t_s, readings.luminance_at(each.t_s))) for each in required
        ),
        visible_s=visible_s,
        visible_forecast=forecast,
        slope=readings.slope_between(*MARKING_S),
        light_sum=readings.light_sum(),
        colours=colours,
        excitation=excitation,
        origin=origin,
        warnings=(*warnings, *readings.slow_end()),
    )


@dataclass(frozen=True)
class _Parabola:
    """ln L = c + b ln(t/t0) + … around a time t0: e^c with its relative σ, and b."""

    luminance: float
    relative_sigma: float
    slope: float


@dataclass(frozen=True)
class _Readings:
    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray | None
    scale_sigma: FloatArray

    @staticmethod
    def checked(
        t_s: ArrayLike, value: ArrayLike, sigma: ArrayLike | None, scale_sigma: ArrayLike
    ) -> "_Readings":
        t, light = np.asarray(t_s, np.float64), np.asarray(value, np.float64)
        known = None if sigma is None else np.broadcast_to(np.asarray(sigma, np.float64), t.shape)
        fewest = MIN_WITHOUT_SIGMA if known is None else FEWEST
        if len(t) < fewest:
            raise FitError(f"expected {fewest} readings or more, got {len(t)}")
        if not (np.isfinite(light).all() and t[0] > 0 and (np.diff(t) > 0).all()):
            raise FitError("expected finite luminances at rising times after lamp off, above 0 s")
        if known is not None and not ((known > 0) & np.isfinite(known)).all():
            raise FitError("expected σ above zero for every reading")
        if not (light > 0).any():
            raise FitError("expected luminances above zero, got none")
        common = np.broadcast_to(np.asarray(scale_sigma, np.float64), t.shape)
        if not ((common >= 0) & np.isfinite(common)).all():
            raise FitError("expected finite relative σ of the scale, 0 or more")
        return _Readings(t, light, known, common)

    def common(self, at_s: float) -> float:
        """Return the relative σ at a time of what neighbouring readings have in common."""
        return float(np.interp(at_s, self.t_s, self.scale_sigma))

    def parabola(self, at_s: float, *, at_end: bool = False) -> _Parabola | None:
        """Fit the readings around a time; None if there are none around it."""
        x = np.log(self.t_s / at_s)
        fewest = MIN_WITHOUT_SIGMA if self.sigma is None else FEWEST
        width = max(NEAR, float(np.sort(np.abs(x))[fewest - 1]))
        used = np.abs(x) <= width
        x, light = x[used], self.value[used]
        is_inside = at_end or x[0] <= 0 <= x[-1]
        if width > FAR or not is_inside or not (light > 0).any():
            return None
        sigma = np.full_like(x, light.max()) if self.sigma is None else self.sigma[used]
        powers = np.stack([np.ones_like(x), x, x**2], axis=1)

        def residuals(c: FloatArray) -> tuple[FloatArray, FloatArray]:
            model = np.exp(powers @ c)
            return (model - light) / sigma, powers * (model / sigma)[:, None]

        start = [math.log(max(float(np.median(light)), 1e-3 * float(light.max()))), -1.0, 0.0]
        fit = least_squares(residuals, start, lower=[-np.inf, -50, -50], upper=[np.inf, 50, 50])
        if not fit.converged:
            return None
        misfit = 1.0
        if self.sigma is None:
            # The standard deviation of Student's t, since few readings tell their own scatter.
            misfit = fit.chi2 / (fit.dof - 2)
        elif chdtrc(fit.dof, fit.chi2) < MISSED:
            misfit = fit.reduced_chi2
        relative = float(fit.sigma[0]) * math.sqrt(misfit)
        level, slope, _ = fit.parameters
        if width > 2 * NEAR and not at_end and (light > 0).all():
            # Few readings far apart: what a parabola may miss is its distance from their chords.
            relative = math.hypot(relative, level - float(np.interp(0.0, x, np.log(light))))
        return _Parabola(math.exp(level), relative, float(slope))

    def luminance_at(self, at_s: float) -> Measured | None:
        """Return the luminance at a time with all errors; None without readings around it."""
        found = self.parabola(at_s)
        if found is None:
            return None
        relative = math.hypot(found.relative_sigma, self.common(at_s))
        return Measured(found.luminance, relative * found.luminance, UNIT)

    def falls_below(self, limit: float) -> Measured | None:
        """Return the time in s at which the luminance falls below a limit; None if never."""

        def height(t: float) -> float:
            found = self.parabola(t)
            return math.nan if found is None else math.log(found.luminance / limit)

        # A first reading may stand too far from the others for a parabola.
        above = next((k for k, t in enumerate(self.t_s) if not math.isnan(height(t))), 0)
        below = len(self.t_s) - 1
        if not (height(self.t_s[above]) > 0 > height(self.t_s[below])):
            return None
        while below - above > 1:
            middle = (above + below) // 2
            above, below = (middle, below) if height(self.t_s[middle]) > 0 else (above, middle)
        t = float(brentq(height, self.t_s[above], self.t_s[below], rtol=1e-6))
        found = self.parabola(t)
        assert found is not None
        relative = math.hypot(found.relative_sigma, self.common(t))
        return Measured(t, t * relative / max(-found.slope, MIN_SLOPE), "s")

    def slope_between(self, early_s: float, late_s: float) -> Measured | None:
        """Return −d ln L/d ln t between two times; what the scale has in common cancels."""
        early, late = self.parabola(early_s), self.parabola(late_s)
        if early is None or late is None:
            return None
        span = math.log(late_s / early_s)
        value = math.log(early.luminance / late.luminance) / span
        added = math.sqrt(abs(self.common(late_s) ** 2 - self.common(early_s) ** 2))
        sigma = math.hypot(early.relative_sigma, late.relative_sigma, added) / span
        return Measured(value, sigma)

    def light_sum(self) -> Measured:
        """Return the integral over all readings, a power law between two neighbours."""
        t, light = self.t_s, self.value
        widths = np.diff(t)
        sums = widths * (light[:-1] + light[1:]) / 2
        positive = (light[:-1] > 0) & (light[1:] > 0)
        power = 1 + np.log(light[1:][positive] / light[:-1][positive]) / np.log(
            t[1:][positive] / t[:-1][positive]
        )
        # ∫ L dt = L₀ t₀ ∫ (t/t₀)^power d ln t
        ratio = np.log(t[1:][positive] / t[:-1][positive])
        is_flat = np.abs(power) < 1e-9
        grown = np.where(is_flat, ratio, np.expm1(power * ratio) / np.where(is_flat, 1.0, power))
        sums[positive] = light[:-1][positive] * t[:-1][positive] * grown
        weights = np.zeros_like(t)
        weights[:-1] += widths / 2
        weights[1:] += widths / 2
        sigma = self._scatter() if self.sigma is None else self.sigma
        total = float(sums.sum())
        scatter = math.sqrt(float(np.square(weights * sigma).sum()))
        common = float(weights @ (self.scale_sigma * np.abs(light)))
        return Measured(total, math.hypot(scatter, common), "mcd s/m²")

    def _scatter(self) -> FloatArray:
        """Return σ of every reading from the bends of ln L from one to the next."""
        positive = np.log(self.value[self.value > 0])
        bends = positive[2:] - 2 * positive[1:-1] + positive[:-2]
        relative = MEDIAN_TO_SIGMA * float(np.median(np.abs(bends))) / math.sqrt(6)
        scatter: FloatArray = relative * np.abs(self.value)
        return scatter

    def slow_end(self) -> tuple[ResultWarning, ...]:
        """Return a warning if a dim end falls more slowly than what is before it."""
        last_s = float(self.t_s[-1])
        end = self.parabola(last_s, at_end=True)
        middle, early = (self.parabola(last_s / EARLIER**number) for number in (1, 2))
        if end is None or middle is None or early is None or end.luminance > DIM_MCD_PER_M2:
            return ()
        going_on = middle.luminance**2 / early.luminance
        sigma = math.hypot(end.relative_sigma, 2 * middle.relative_sigma, early.relative_sigma)
        if math.log(end.luminance / going_on) < SLOWER_SIGMAS * sigma:
            return ()
        return (
            Disturbance(
                "constant-light",
                "after {after} the luminance falls more slowly than before: a constant light, or "
                "an error of the meter's zero, of {light_mcd_per_m2:.2g} mcd/m² would do that; "
                "read the meter with the sample covered",
                after=duration_text(last_s / EARLIER),
                after_s=last_s / EARLIER,
                light_mcd_per_m2=end.luminance - going_on,
            ),
        )

    def forecast(self, limit: float) -> tuple[ForecastTime | None, tuple[ResultWarning, ...]]:
        """Return when the luminance falls below a limit after the last reading, or why not."""
        end = self.parabola(float(self.t_s[-1]), at_end=True)
        if end is not None and end.luminance * (1 + NORMAL_95 * end.relative_sigma) < limit:
            return None, (
                Undetermined(
                    "limit-before-record",
                    "the last readings are below {limit_mcd_per_m2:g} mcd/m², and no reading "
                    "before is clearly above it: begin earlier after lamp off",
                    limit_mcd_per_m2=limit,
                ),
            )
        constant = float(self.scale_sigma.min())
        added = math.sqrt(float(self.scale_sigma[-1]) ** 2 - constant**2)
        # What comes on top at the end is an error of the zero: it is as large at the limit.
        zero = added * max(float(self.value[-1]), limit) / limit
        try:
            return (
                forecast_crossing(
                    self.t_s, self.value, self.sigma, limit, math.hypot(constant, zero)
                ),
                (),
            )
        except FitError as error:
            return None, (
                Undetermined(
                    "no-forecast",
                    "there is no forecast of when {limit_mcd_per_m2:g} mcd/m² is reached: {reason}",
                    limit_mcd_per_m2=limit,
                    reason=str(error),
                ),
            )
