"""The irradiance file: the lamp on the sample, by itself, through the LVF or in selected bands."""

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.errors import UsageError
from labrig.foundation.models import FrozenModel, NotNegative, Positive
from labrig.optics import Strip

Numbers = tuple[NotNegative, ...]


class CardLight(FrozenModel):
    """The camera's signal of the grey card under the lamp itself, which links counts to radiance.

    Attributes
    ----------
    iso, f_number
        Settings of the camera; `f_number` is null for a lens that does not report it.
    channels
        Names of the channels.
    dn_per_s, sigma_dn_per_s
        Mean signal along the strip's place in DN/s, one number for each channel, and σ.
    """

    iso: Positive
    f_number: Positive | None
    channels: tuple[str, ...]
    dn_per_s: tuple[Positive, ...]
    sigma_dn_per_s: Numbers

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        if {len(self.dn_per_s), len(self.sigma_dn_per_s)} != {len(self.channels)}:
            raise ValueError(
                f"expected {len(self.channels)} numbers, one a channel, in 'dn_per_s' and its σ"
            )
        return self


class IrradianceFile(FrozenModel):
    """Irradiance E per band on one scale, directly under the lamp, and of parts of its light.

    These are the places behind the LVF, or lights that are selected one after another.

    Attributes
    ----------
    lamp
        Name of the lamp's spectrum.
    bands_nm
        Rising edges of the bands in nm; one more than there are bands.
    vector_length
        Euclidean length of `direct`, to which excitation rates found with this file belong.
    direct, direct_sigma
        Irradiance E = ∫ E dλ of each band directly under the lamp, and σ.
    position
        Middles of `strip.slices()`: 0 at the blue end, 1 at the red end; none of selected lights.
    lights
        Names of the selected lights; none of the LVF.
    centre_nm, width_nm
        Mean wavelength of each of `lights` and its standard deviation, in nm.
    through, through_sigma
        Irradiance of each band behind the LVF, a row for each position, or of each of `lights`, and
        σ.
    wavelength_sigma_nm
        σ in nm of an error that all wavelengths of each of `lights` have in common.
    cells_nm
        Rising edges of narrow cells in nm, of which every band contains a number; none of the LVF.
    direct_cells, through_cells
        Irradiance of each cell directly under the lamp, and a row of them for each of `lights`.
    scale_sigma
        Relative standard uncertainty of `through` over `direct`, common to all rows.
    ratio, ratio_sigma
        Ratio Σ `direct` over Σ `through` of each row, and σ.
    strip
        Position of the LVF on the sample, as the camera sees the sample; null of selected lights.
    card
        Signal of the grey card under the lamp itself; null if it was not kept.
    illuminance_lux, illuminance_lux_sigma
        Illuminance by the lamp itself at the sample in lux, read from a meter, and σ; null if it
        was not read.
    source, run
        Origin of the numbers.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.calibration import IRRADIANCE_KIND
    >>> lamp = IRRADIANCE_KIND.read(Path("irradiance.yaml"))
    >>> f"|E| = {np.linalg.norm(lamp.direct):.3f} in {len(lamp.direct)} bands"
    '|E| = 1.000 in 8 bands'
    >>> len(lamp.through) == len(lamp.position)
    True
    """

    kind: Literal["irradiance"] = "irradiance"
    lamp: str
    bands_nm: tuple[Positive, ...]
    vector_length: Positive = 1.0
    direct: Numbers
    direct_sigma: Numbers
    position: tuple[Annotated[float, Field(ge=0, le=1)], ...] = ()
    lights: tuple[str, ...] = ()
    centre_nm: tuple[Positive, ...] = ()
    width_nm: Numbers = ()
    through: tuple[Numbers, ...]
    through_sigma: tuple[Numbers, ...]
    wavelength_sigma_nm: Numbers = ()
    cells_nm: tuple[Positive, ...] = ()
    direct_cells: Numbers = ()
    through_cells: tuple[Numbers, ...] = ()
    scale_sigma: NotNegative
    ratio: tuple[Positive, ...]
    ratio_sigma: Numbers
    strip: Strip | None = None
    card: CardLight | None = None
    illuminance_lux: Positive | None = None
    illuminance_lux_sigma: NotNegative | None = None
    source: str = ""
    run: str | None = None

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        _rising(self.bands_nm, "bands_nm")
        if (self.strip is None) != (not self.position) or bool(self.lights) == bool(self.position):
            raise ValueError("expected 'strip' with 'position' of the LVF, or 'lights'")
        if self.position:
            _rising(self.position, "position")
        bands, places = len(self.bands_nm) - 1, len(self.position or self.lights)
        rows = (
            self.direct,
            self.direct_sigma,
            *self.through,
            *self.through_sigma,
        )
        if any(len(row) != bands for row in rows):
            raise ValueError(f"expected {bands} numbers for each irradiance, one a band")
        columns = (self.through, self.through_sigma, self.ratio, self.ratio_sigma)
        if any(len(column) != places for column in columns):
            raise ValueError(
                f"expected {places} entries, one a position or light, in 'through', 'ratio' and "
                "their σ"
            )
        of_lights = (self.wavelength_sigma_nm, self.centre_nm, self.width_nm, self.through_cells)
        if any(len(column) != len(self.lights) for column in of_lights):
            raise ValueError(
                f"expected {len(self.lights)} entries, one a light, in 'wavelength_sigma_nm', "
                "'centre_nm', 'width_nm' and 'through_cells'"
            )
        self._check_cells()
        return self

    def _check_cells(self) -> None:
        """Raise ValueError if the cells do not fill the bands, or have no irradiance."""
        if not self.lights:
            if self.cells_nm or self.direct_cells:
                raise ValueError("expected 'cells_nm' and 'direct_cells' of 'lights' only")
            return
        _rising(self.cells_nm, "cells_nm")
        if not set(self.bands_nm) <= set(self.cells_nm) or not (
            self.cells_nm[0] == self.bands_nm[0] and self.cells_nm[-1] == self.bands_nm[-1]
        ):
            raise ValueError("expected every edge of 'bands_nm' in 'cells_nm', which end with them")
        rows = (self.direct_cells, *self.through_cells)
        if any(len(row) != len(self.cells_nm) - 1 for row in rows):
            raise ValueError(
                f"expected {len(self.cells_nm) - 1} numbers, one a cell, in 'direct_cells' and in "
                "every row of 'through_cells'"
            )

    def lvf_strip(self) -> Strip:
        """Return the position of the LVF on the sample.

        Raises
        ------
        UsageError
            It is the irradiance of selected lights.
        """
        if self.strip is None:
            raise UsageError(
                "expected the irradiance behind the variable filter, got that of "
                f"{', '.join(self.lights)}; run irradiance without 'select', or name another run "
                "('optics: {irradiance: …}')"
            )
        return self.strip


IRRADIANCE_KIND = CalibrationKind(
    name="irradiance",
    protocol="irradiance",
    optics_key="irradiance",
    file_name="irradiance.yaml",
    model=IrradianceFile,
)


def _rising(values: tuple[float, ...], name: str) -> None:
    if len(values) < 2 or any(right <= left for left, right in pairwise(values)):
        raise ValueError(f"expected two or more rising numbers in '{name}', got {list(values)}")
