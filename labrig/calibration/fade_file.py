"""The fade file: turn-off and turn-on transients of the lamp, band by band."""

from itertools import pairwise
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.arrays import FloatArray
from labrig.foundation.models import FrozenModel, NotNegative, Positive

Row = tuple[NotNegative, ...]


class Change(FrozenModel):
    """Irradiance over that of the steady lamp after a switch.

    Attributes
    ----------
    t_s
        Rising times in seconds since the switch, the first one 0.
    fraction, sigma
        Fraction of the steady irradiance and σ, a row for each time, a number for each band;
        piecewise linear in between.
    """

    t_s: Annotated[tuple[NotNegative, ...], Field(min_length=2)]
    fraction: tuple[Row, ...]
    sigma: tuple[Row, ...]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.t_s[0] != 0 or any(right <= left for left, right in pairwise(self.t_s)):
            raise ValueError("expected times in 't_s' that rise from 0")
        if len(self.fraction) != len(self.t_s) or len(self.sigma) != len(self.t_s):
            raise ValueError("expected a row of 'fraction' and of 'sigma' for every time in 't_s'")
        if len({len(row) for row in (*self.fraction, *self.sigma)}) != 1:
            raise ValueError("expected as many numbers in each row as there are bands")
        return self

    def equivalent_s(self) -> FloatArray:
        """Return the equivalent steady duration ∫ fraction dt in s, shape (bands,)."""
        steps, fraction = np.diff(self.t_s), np.array(self.fraction)
        total: FloatArray = steps @ (fraction[1:] + fraction[:-1]) / 2
        return total


class Warming(FrozenModel):
    """Warm-up transient of a lamp: its light over that of the warm lamp is 1 − d e^(−t/τ).

    Attributes
    ----------
    deficit, deficit_sigma
        Fraction d of the warm lamp's light that is missing at first, and σ, common to all
        wavelengths.
    time_constant_s
        Time constant τ of the housing in seconds.
    """

    deficit: Annotated[float, Field(ge=0, lt=1)]
    deficit_sigma: NotNegative
    time_constant_s: Positive


class FadeFile(FrozenModel):
    """Result of the protocol `fade`: the transients of a lamp.

    Attributes
    ----------
    bands_nm
        Rising edges of the bands in nm; one more than there are bands.
    fade, rise
        Transients after switching off and on; null if not measured.
    warming
        Slow warm-up of the lamp's housing; null if not measured.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import FADE_KIND
    >>> lamp = FADE_KIND.read(Path("fade.yaml"))
    >>> t_s, fraction = lamp.in_bands(lamp.fade, [400, 500, 600, 700])
    >>> fraction.shape == (len(t_s), 3)
    True
    >>> lamp.fade.equivalent_s()[:2].round(2).tolist()
    [0.03, 0.03]
    """

    kind: Literal["fade"] = "fade"
    lamp: str = ""
    bands_nm: Annotated[tuple[Positive, ...], Field(min_length=2)]
    fade: Change
    rise: Change | None = None
    warming: Warming | None = None
    source: str = ""
    run: str | None = None

    @model_validator(mode="after")
    def _fits_its_bands(self) -> Self:
        if any(right <= left for left, right in pairwise(self.bands_nm)):
            raise ValueError("expected rising edges in 'bands_nm'")
        bands = len(self.bands_nm) - 1
        if any(
            len(change.fraction[0]) != bands
            for change in (self.fade, self.rise)
            if change is not None
        ):
            raise ValueError(f"expected {bands} numbers in each row of 'fraction', one a band")
        return self

    def in_bands(self, change: Change, edges_nm: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return times (n,) and fractions (n, bands) of a transient at other bands' middles."""
        edges, own_edges = np.asarray(edges_nm, dtype=np.float64), np.array(self.bands_nm)
        middles, measured = (edges[1:] + edges[:-1]) / 2, (own_edges[1:] + own_edges[:-1]) / 2
        fraction = [np.interp(middles, measured, row) for row in change.fraction]
        return np.array(change.t_s), np.array(fraction)


FADE_KIND = CalibrationKind(
    name="fade",
    protocol="fade",
    optics_key="fade",
    file_name="fade.yaml",
    model=FadeFile,
)
