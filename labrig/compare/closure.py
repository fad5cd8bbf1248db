"""Closure: does what was measured band by band predict the charging under the whole lamp?"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from numpy.typing import ArrayLike, NDArray

from labrig.errors import DataError
from labrig.material.rates import concentration, phi1
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    MUTED,
    error_bars,
    figure_style,
    new_figure,
    place,
    points,
)
from labrig.report.legend import legend_above, lined, marked
from labrig.report.sections import Picture
from labrig.written_numbers import rounded

FloatArray = NDArray[np.float64]

HEIGHT_PT = 300.0
POINTS = 200
#: From so many times between the shortest and the longest charge, the axis is logarithmic.
MANY_TIMES = 20.0


@dataclass(frozen=True, eq=False)
class Closure:
    """Measured against predicted levels.

    Attributes
    ----------
    predicted
        Shape (n,), in the unit of the levels.
    rms_percent
        RMS deviation in % of the RMS of the predicted levels.
    rms_sigma
        RMS deviation in σ: about 1 if noise and what the prediction may be off by explain it.
    """

    picture: Picture
    predicted: FloatArray
    rms_percent: float
    rms_sigma: float


def closure(
    charge_s: ArrayLike,
    level: ArrayLike,
    sigma: ArrayLike,
    *,
    irradiance: ArrayLike,
    k_e_per_s: ArrayLike,
    k_r_per_s: ArrayLike,
    full_level: ArrayLike,
    r0: ArrayLike = 0.0,
    dark_s: ArrayLike = 0.0,
    exposure_s: ArrayLike = 0.0,
    unit: str = "DN/s",
) -> Closure:
    """Levels after charges of different lengths, each from the same concentrations.

    With m states, b bands and n charges: κ_i = Σ_j k_e,ij E_j, r_i after the charge by the rate
    equation, and level = Σ_i full_level_i r_i e^(−k_r,i d) over the mean of an exposure.

    Parameters
    ----------
    charge_s, level, sigma
        Shape (n,): how long the lamp shone (its fade counts as so much longer at full light), what
        was then photographed, and by how much it and the prediction may differ.
    irradiance
        Shape (b,): of that lamp, in the norm to which `k_e_per_s` belongs.
    k_e_per_s, k_r_per_s
        Shapes (m, b) and (m,).
    full_level
        Shape (m,): level of each state at r = 1, as measured by Λ_i k_r,i.
    r0
        Concentrations before each charge, one number, (m,) or (n, m).
    dark_s, exposure_s
        From lamp off to the begin of the exposure, and its length; one number or (n,).

    Raises
    ------
    DataError
        Shapes that do not agree, numbers that are not finite, or a σ that is not above 0.
    """
    sample = Charging(*map(_floats, (k_e_per_s, k_r_per_s, full_level, irradiance)))
    charge, measured, noise = map(_floats, (charge_s, level, sigma))
    if not (charge.ndim == 1 and charge.shape == measured.shape == noise.shape and charge.size):
        raise DataError("closure: expected as many levels and σ as charges, at least one")
    n, m = len(charge), len(sample.k_r_per_s)
    start = np.broadcast_to(_floats(r0), (n, m))
    dark, exposure = (np.broadcast_to(_floats(one), n) for one in (dark_s, exposure_s))
    if not all(np.isfinite(one).all() for one in (charge, measured, noise, start, dark, exposure)):
        raise DataError("closure: expected finite numbers, got NaN or infinity")
    if not (noise > 0).all():
        raise DataError("closure: expected σ above 0")
    predicted = sample.level(charge, start, dark, exposure)
    order, line_s = np.argsort(charge, kind="stable"), _line(charge)

    def along(column: FloatArray) -> FloatArray:
        return np.interp(line_s, charge[order], column[order])

    starts = np.stack([along(column) for column in start.T], axis=1)
    line = sample.level(line_s, starts, along(dark), along(exposure))
    rms_percent = 100 * _rms(measured - predicted) / max(_rms(predicted), np.finfo(float).tiny)
    rms_sigma = _rms((measured - predicted) / noise)
    with figure_style():
        figure = _figure(charge, measured, noise, predicted, (line_s, line), unit)
    caption = (
        "Charging under the whole lamp: the curve is predicted from the rates measured band by "
        "band, nothing is fitted; points are measured, with ± 1 σ of both. RMS deviation "
        f"{rms_percent:.2g} % of the RMS level, {rms_sigma:.2g} σ."
    )
    return Closure(Picture("closure", figure, caption), predicted, rms_percent, rms_sigma)


@dataclass(frozen=True, eq=False)
class Charging:
    """A sample under the lamp: (m, b) and (m,) rates, (m,) levels at r = 1, (b,) irradiance."""

    k_e_per_s: FloatArray
    k_r_per_s: FloatArray
    full_level: FloatArray
    irradiance: FloatArray

    def __post_init__(self) -> None:
        m, b = len(self.k_r_per_s), len(self.irradiance)
        if self.k_e_per_s.shape != (m, b) or self.full_level.shape != (m,):
            raise DataError(
                f"closure: expected k_e of shape {(m, b)} and {m} full levels, got "
                f"{self.k_e_per_s.shape} and {self.full_level.shape}"
            )

    def level(
        self, charge_s: FloatArray, r0: FloatArray, dark_s: FloatArray, exposure_s: FloatArray
    ) -> FloatArray:
        """After charges from `r0`, (n, m); all else (n,)."""
        kappa, k_r = self.k_e_per_s @ self.irradiance, self.k_r_per_s
        charged = concentration(r0, kappa, k_r, charge_s[:, np.newaxis])
        faded = np.exp(-np.multiply.outer(dark_s, k_r)) * phi1(np.multiply.outer(exposure_s, k_r))
        return np.asarray((charged * faded) @ self.full_level)


def _floats(values: ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64)


def _line(charge_s: FloatArray) -> FloatArray:
    low, high = float(charge_s.min()), float(charge_s.max())
    if _is_logarithmic(charge_s):
        return np.geomspace(low, high, POINTS)
    return np.linspace(min(low, 0.0), high, POINTS)


def _is_logarithmic(charge_s: FloatArray) -> bool:
    low = float(charge_s.min())
    return low > 0 and float(charge_s.max()) > MANY_TIMES * low


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _figure(
    charge_s: FloatArray,
    measured: FloatArray,
    sigma: FloatArray,
    predicted: FloatArray,
    curve: tuple[FloatArray, FloatArray],
    unit: str,
) -> Figure:
    figure = new_figure(HEIGHT_PT)
    upper = place(figure, left=LEFT_PT, bottom=128, right=12, top=30)
    upper.plot(*curve, color=MUTED, linewidth=1.2)
    error_bars(upper, charge_s, measured, sigma, INK)
    points(upper, charge_s, measured, "o", INK, INK)
    upper.set_ylim(0, 1.1 * float(max(measured.max(), curve[1].max())))
    upper.set_ylabel(f"Level / ({unit})" if "/" in unit else f"Level / {unit}")
    upper.tick_params(labelbottom=False)
    lower = place(figure, left=LEFT_PT, bottom=38, right=12, top=188, share_x=upper)
    if _is_logarithmic(charge_s):
        upper.set_xscale("log")
        upper.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        upper.xaxis.set_minor_locator(NullLocator())
    upper.xaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    full = float(np.sqrt(np.mean(predicted**2))) or 1.0
    share, share_sigma = 100 * (measured - predicted) / full, 100 * sigma / full
    lower.axhline(0, color=MUTED, linewidth=1.2)
    error_bars(lower, charge_s, share, share_sigma, INK)
    points(lower, charge_s, share, "o", INK, INK, size=3.0)
    reach = 1.15 * float(np.max(np.abs(share) + share_sigma))
    lower.set_ylim(-reach, reach)
    lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: rounded(value)))
    lower.set_ylabel("Deviation / %")
    lower.set_xlabel("Charge / s")
    legend_above(figure, [marked("measured", "o", INK), lined("predicted", MUTED)], columns=2)
    return figure
