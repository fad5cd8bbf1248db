"""The LVF file: transmission of a linear variable filter, and its position in the frame."""

from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.models import Finite, FrozenModel, NotNegative
from labrig.optics import Bands, CameraResponse, Lvf, Strip, WavelengthMap

Numbers = tuple[Finite, ...]


class BandColumns(FrozenModel):
    """Parameters of `labrig.optics.Bands`, one number for each position."""

    centre_nm: Numbers
    fwhm_nm: Numbers
    skew: Numbers
    peak: Numbers
    leakage: Numbers

    @classmethod
    def of(cls, bands: Bands) -> Self:
        """Convert from arrays."""
        return cls(**{name: tuple(getattr(bands, name).tolist()) for name in cls.model_fields})

    def bands(self) -> Bands:
        """Convert to arrays."""
        return Bands(*(np.array(getattr(self, name)) for name in type(self).model_fields))


class WavelengthColumns(FrozenModel):
    """Wavelength along the whole strip, as in `labrig.optics.WavelengthMap`."""

    coefficients: Numbers
    span: tuple[Finite, Finite]
    covariance: tuple[Numbers, ...]

    @classmethod
    def of(cls, wavelengths: WavelengthMap) -> Self:
        """Convert from arrays."""
        count = len(wavelengths.coefficients)
        map_covariance = wavelengths.covariance
        covariance = np.zeros((count, count)) if map_covariance is None else map_covariance
        return cls(
            coefficients=tuple(wavelengths.coefficients.tolist()),
            span=wavelengths.span,
            covariance=tuple(tuple(row) for row in covariance.tolist()),
        )

    def map(self) -> WavelengthMap:
        """Convert to arrays."""
        return WavelengthMap(np.array(self.coefficients), self.span, np.array(self.covariance))


class CurveColumns(FrozenModel):
    """Sensitivity curves of a camera, as in `labrig.optics.CameraResponse`."""

    name: str
    wavelength_nm: Numbers
    channels: tuple[str, ...]
    sensitivity: tuple[tuple[NotNegative, ...], ...]

    @classmethod
    def of(cls, camera: CameraResponse) -> Self:
        """Convert from arrays."""
        return cls(
            name=camera.name,
            wavelength_nm=tuple(camera.wavelength_nm.tolist()),
            channels=camera.channels,
            sensitivity=tuple(tuple(row) for row in camera.sensitivity.tolist()),
        )

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        rows = len(self.wavelength_nm)
        if [len(row) for row in self.sensitivity] != [len(self.channels)] * rows:
            raise ValueError(
                f"expected {rows} rows of 'sensitivity', one a wavelength, with a number for each "
                f"of {', '.join(self.channels)}"
            )
        return self

    def response(self) -> CameraResponse:
        """Convert to arrays."""
        return CameraResponse(
            self.name, np.array(self.wavelength_nm), np.array(self.sensitivity), self.channels
        )


class LvfFile(FrozenModel):
    """A calibrated linear variable filter.

    Attributes
    ----------
    position
        Position of each band along the strip: 0 at its blue end, 1 at its red end.
    bands, sigma
        Parameters of T_p(λ) and one standard deviation, that of a width at the same ∫ T_p dλ, of a
        peak at the same width; all relative to one unknown factor.
    remainder_nm, remainder
        Deviation of T_p(λ) from the bands' shape at wavelengths in nm, a row for each position.
    wavelengths
        Wavelength along the strip from the mercury lines alone, without the colour filters.
    before_camera, on_sample
        Strip in the frame when it is in front of the camera, and when it lies on the sample in the
        pose in which the camera sees the sample.
    camera
        Camera's curves as fitted with the colour filters; the transmission belongs to these.
    source, run
        Origin of the numbers.
    """

    kind: Literal["lvf"] = "lvf"
    position: Numbers
    bands: BandColumns
    sigma: BandColumns
    remainder_nm: Numbers = ()
    remainder: tuple[Numbers, ...] = ()
    wavelengths: WavelengthColumns
    before_camera: Strip | None = None
    on_sample: Strip | None = None
    camera: CurveColumns | None = None
    source: str = ""
    run: str | None = None

    @model_validator(mode="after")
    def _is_a_filter(self) -> Self:
        count = len(self.position)
        columns = [getattr(part, name) for part in (self.bands, self.sigma) for name in _FIGURES]
        if any(len(column) != count for column in columns):
            raise ValueError(f"expected {count} numbers, one a position, in every figure")
        rows = count if self.remainder_nm else 0
        if [len(row) for row in self.remainder] != [len(self.remainder_nm)] * rows:
            raise ValueError(
                "expected a 'remainder' of one row a position, one number a wavelength"
            )
        self.wavelengths.map()
        _ = self.lvf
        return self

    @property
    def lvf(self) -> Lvf:
        """Filter at positions from 0 (blue end) to 1 (red end)."""
        nodes = np.array(self.remainder_nm)
        remainder = np.array(self.remainder).reshape(len(self.remainder), len(nodes))
        return Lvf(
            np.array(self.position), self.bands.bands(), self.sigma.bands(), nodes, remainder
        )


_FIGURES = tuple(BandColumns.model_fields)


LVF_KIND = CalibrationKind(
    name="lvf",
    protocol="lvf_calibration",
    optics_key="lvf",
    file_name="lvf.yaml",
    model=LvfFile,
)
