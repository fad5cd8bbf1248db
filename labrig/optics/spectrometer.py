"""Readings of a spectrometer: raw counts, their correction, and the absolute scale by a lamp."""

import json
import os
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.input_file import read_text
from labrig.optics.spectrum import Spectrum

#: Number of pixels with the most similar light whose variances are averaged.
POOL = 101
#: Signs with which a formula begins in a spreadsheet, after a separator of cells.
_FORMULA = re.compile(r"(?<=[,;|])[=+\-@]")
#: First line of a reading's file.
FORMAT = "# labrig spectrometer reading 1"


@dataclass(frozen=True, eq=False)
class MeasuredSpectrum:
    """Corrected counts of a spectrometer.

    Attributes
    ----------
    wavelength_nm : ndarray, shape (pixels,)
        Rising wavelengths in nm.
    counts : ndarray, shape (pixels,)
        Mean counts above the dark, proportional to the light.
    sigma : ndarray, shape (pixels,), or None
        Standard error of the counts from the scatter of the repetitions; None for a single one.
    saturated : ndarray of bool, shape (pixels,)
        Whether any repetition was saturated there, so that the counts are too small.
    integration_s
        Integration time in seconds.
    irradiance : ndarray, shape (pixels,), or None
        Irradiance in W m⁻² nm⁻¹, NaN where the calibration says nothing; None without calibration.
    irradiance_sigma : ndarray, shape (pixels,), or None
        Standard uncertainty of the irradiance, that of the calibration included, which all
        readings share; None without calibration, or for a single repetition.
    """

    wavelength_nm: FloatArray
    counts: FloatArray
    sigma: FloatArray | None
    saturated: BoolArray
    integration_s: float
    irradiance: FloatArray | None = None
    irradiance_sigma: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class SpectrometerReading:
    """Raw counts of a spectrometer, with all that their correction needs.

    Parameters
    ----------
    wavelength_nm : ndarray, shape (pixels,)
        Rising wavelengths in nm, from the instrument's own calibration.
    raw_counts : ndarray, shape (repetitions, pixels)
        Counts as the instrument gave them.
    integration_s
        Integration time of each repetition in seconds.
    saturation_counts
        Counts from which a pixel is saturated.
    dark_pixels
        Places of the pixels that no light reaches; may be empty.
    nonlinearity
        Coefficients c₀, c₁, … of the instrument's polynomial of relative response over counts above
        the dark pixels; empty for a linear instrument.
    calibration
        Irradiance in W m⁻² nm⁻¹ of a light that gives one corrected count per second; None if it is
        not known.

    Raises
    ------
    ValueError
        Shapes disagree, or a wavelength or a count is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import SpectrometerReading
    >>> wavelength_nm = np.array([400.0, 500.0, 600.0, 700.0])
    >>> lit = np.array([[100.0, 1100.0, 2100.0, 65535.0], [102.0, 1104.0, 2100.0, 65535.0]])
    >>> reading = SpectrometerReading(wavelength_nm, lit, 0.1, 65535.0, dark_pixels=(0,))
    >>> spectrum = reading.corrected()
    >>> spectrum.counts.tolist()
    [0.0, 1001.0, 1999.0, 65434.0]
    >>> spectrum.saturated.tolist()
    [False, False, False, True]
    """

    wavelength_nm: FloatArray
    raw_counts: FloatArray
    integration_s: float
    saturation_counts: float
    dark_pixels: tuple[int, ...] = ()
    nonlinearity: tuple[float, ...] = ()
    calibration: Spectrum | None = None

    def __post_init__(self) -> None:
        pixels = len(self.wavelength_nm)
        if self.raw_counts.ndim != 2 or self.raw_counts.shape[1] != pixels or not pixels:
            raise ValueError(f"expected counts for {pixels} pixels, got {self.raw_counts.shape}")
        if not len(self.raw_counts):
            raise ValueError("expected at least one repetition")
        if not (np.isfinite(self.wavelength_nm).all() and np.isfinite(self.raw_counts).all()):
            raise ValueError("some wavelength or count is infinite or NaN")
        if (np.diff(self.wavelength_nm) <= 0).any():
            raise ValueError("expected wavelengths that rise")
        if not self.integration_s > 0:
            raise ValueError(f"expected an integration time above 0, got {self.integration_s}")
        if any(not 0 <= pixel < pixels for pixel in self.dark_pixels):
            raise ValueError(f"expected dark pixels from 0 to {pixels - 1}")

    @property
    def saturated(self) -> BoolArray:
        """Whether any repetition was saturated, shape (pixels,)."""
        saturated: BoolArray = np.any(self.raw_counts >= self.saturation_counts, axis=0)
        return saturated

    def corrected(self, dark: "SpectrometerReading | None" = None) -> MeasuredSpectrum:
        """Return the counts above the dark, linear in the light.

        From each repetition the mean of its dark pixels is subtracted, since the offset drifts from
        one to the next. Counts above that offset are divided by the polynomial of relative
        response. The mean of a dark reading, corrected in the same way, is then subtracted: that
        removes dark current, what differs from pixel to pixel, and light of the surroundings.

        Parameters
        ----------
        dark
            Reading with the shutter closed or the lights off, with the same integration time; None
            if the dark pixels are to suffice.

        Raises
        ------
        DataError
            The dark reading has another integration time, or is of another instrument.
        """
        linear = self._linear()
        counts, variance = linear.mean(axis=0), _variance_of_mean(linear)
        if dark is not None:
            self._require_comparable(dark)
            dark_linear = dark._linear()
            counts = counts - dark_linear.mean(axis=0)
            dark_variance = _variance_of_mean(dark_linear)
            known = variance is not None and dark_variance is not None
            variance = variance + dark_variance if known else None  # type: ignore[operator]
        sigma = None if variance is None else np.sqrt(variance)
        irradiance, irradiance_sigma = self._calibrated(counts, sigma)
        return MeasuredSpectrum(
            wavelength_nm=self.wavelength_nm,
            counts=counts,
            sigma=sigma,
            saturated=self.saturated,
            integration_s=self.integration_s,
            irradiance=irradiance,
            irradiance_sigma=irradiance_sigma,
        )

    def text(self) -> str:
        """Return the reading as the text of a file, which `read_spectrometer_reading` reads."""
        facts = json.dumps(
            {
                "integration_s": self.integration_s,
                "saturation_counts": self.saturation_counts,
                "dark_pixels": list(self.dark_pixels),
                "nonlinearity": list(self.nonlinearity),
            }
        )
        if self.calibration is not None:
            facts = f'{facts[:-1]}, "calibration": {_spectrum_text(self.calibration)}}}'
        names = [f"raw_{number + 1}" for number in range(len(self.raw_counts))]
        wavelengths = _texts_again(np.asarray(self.wavelength_nm, np.float64).tobytes())
        rows = map(",".join, zip(wavelengths, *map(_texts, self.raw_counts), strict=True))
        head = [FORMAT, f"# {facts}", ",".join(["wavelength_nm", *names])]
        return "\n".join([*head, *rows]) + "\n"

    def _linear(self) -> FloatArray:
        """Return counts above the dark pixels, divided by the relative response."""
        counts = self.raw_counts
        if self.dark_pixels:
            counts = counts - counts[:, list(self.dark_pixels)].mean(axis=1, keepdims=True)
        if not self.nonlinearity:
            return counts
        # Beyond the range of counts the polynomial says nothing.
        within = np.clip(counts, 0.0, self.saturation_counts)
        linear: FloatArray = counts / np.polynomial.polynomial.polyval(within, self.nonlinearity)
        return linear

    def _require_comparable(self, dark: "SpectrometerReading") -> None:
        if not np.array_equal(dark.wavelength_nm, self.wavelength_nm):
            raise DataError(
                "expected a dark reading of the same spectrometer, got one with other wavelengths; "
                "read it anew"
            )
        if not np.isclose(dark.integration_s, self.integration_s, rtol=1e-6, atol=0.0):
            raise DataError(
                f"expected a dark reading with the same integration time, {self.integration_s:g} s,"
                f" got one with {dark.integration_s:g} s; read it anew"
            )

    def _calibrated(
        self, counts: FloatArray, sigma: FloatArray | None
    ) -> tuple[FloatArray | None, FloatArray | None]:
        if self.calibration is None:
            return None, None
        factor, factor_sigma = _factor_at(self.calibration, self.wavelength_nm)
        irradiance = factor * counts / self.integration_s
        if sigma is None:
            return irradiance, None
        return irradiance, np.hypot(factor * sigma, factor_sigma * counts) / self.integration_s


def _factor_at(calibration: Spectrum, wavelength_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return factor and σ at some wavelengths, NaN outside of the calibration."""
    sigma = calibration.sigma
    known = np.zeros_like(calibration.value) if sigma is None else sigma
    factor, factor_sigma = (
        np.interp(wavelength_nm, calibration.wavelength_nm, curve, left=np.nan, right=np.nan)
        for curve in (calibration.value, known)
    )
    return factor, factor_sigma


def _variance_of_mean(repetitions: FloatArray) -> FloatArray | None:
    """Return the variance of the mean, averaged over pixels with similar light; None for one.

    A pixel's own scatter over a few repetitions says little; noise depends on the light alone.
    """
    number, pixels = repetitions.shape
    if number < 2:
        return None
    order = np.argsort(repetitions.mean(axis=0), kind="stable")
    scatter = repetitions.var(axis=0, ddof=1)[order]
    window = np.ones(min(POOL, pixels))
    pooled = np.empty(pixels)
    shares = np.convolve(np.ones(pixels), window, mode="same")
    pooled[order] = np.convolve(scatter, window, mode="same") / shares
    variance: FloatArray = pooled / number
    return variance


def _texts(column: FloatArray) -> list[str]:
    """Return numbers as text; whole ones, as most counts are, without a point."""
    with np.errstate(invalid="ignore"):
        whole = column.astype(np.int64)
    if np.array_equal(whole, column):
        return list(map(str, whole.tolist()))
    return [repr(number).removesuffix(".0") for number in column.tolist()]


# All readings of a run have the same wavelengths and calibration, which take longer to write and to
# read than the counts.
@lru_cache(maxsize=4)
def _texts_again(wavelength_nm: bytes) -> list[str]:
    """Return the text of wavelengths, given as the bytes of their array."""
    return _texts(np.frombuffer(wavelength_nm))


@lru_cache(maxsize=4)
def _spectrum_text(spectrum: Spectrum) -> str:
    content = {
        "name": "",
        "wavelength_nm": spectrum.wavelength_nm.tolist(),
        "value": spectrum.value.tolist(),
        "sigma": None if spectrum.sigma is None else spectrum.sigma.tolist(),
    }
    # The comment is a row of cells to a spreadsheet, in which a name is to begin no formula.
    name = _FORMULA.sub(lambda sign: f"\\u{ord(sign[0]):04x}", json.dumps(spectrum.name))
    return json.dumps(content).replace('"name": ""', f'"name": {name}', 1)


@lru_cache(maxsize=4)
def _facts(line: str) -> dict[str, Any]:
    """Return what the second line of a reading's file says, as arguments of a reading."""
    facts = json.loads(line.removeprefix("# "))
    calibration = facts.get("calibration")
    return {
        "integration_s": float(facts["integration_s"]),
        "saturation_counts": float(facts["saturation_counts"]),
        "dark_pixels": tuple(int(pixel) for pixel in facts["dark_pixels"]),
        "nonlinearity": tuple(float(coefficient) for coefficient in facts["nonlinearity"]),
        "calibration": None if calibration is None else _spectrum(calibration),
    }


def read_spectrometer_reading(path: str | os.PathLike[str]) -> SpectrometerReading:
    """Read the file of one reading of a spectrometer in a run folder.

    Parameters
    ----------
    path
        File that `SpectrometerReading.text` has made.

    Returns
    -------
    SpectrometerReading
        Raw counts with all that their correction needs.

    Raises
    ------
    DataError
        The file is no such reading, or it was damaged.
    UsageError
        The file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.optics import SpectrometerReading, read_spectrometer_reading
    >>> counts = np.array([[1.0, 2.0]])
    >>> reading = SpectrometerReading(np.array([400.0, 401.0]), counts, 0.1, 65535.0)
    >>> _ = Path("000001.csv").write_text(reading.text())
    >>> read_spectrometer_reading("000001.csv").raw_counts.tolist()
    [[1.0, 2.0]]
    """
    text = read_text(Path(path))
    lines = text.splitlines()
    try:
        if len(lines) < 4 or lines[0] != FORMAT:
            raise ValueError(f"it does not begin with '{FORMAT}'")
        if "" in lines:
            raise ValueError("a line is empty")
        facts = _facts(lines[1])
        table = np.loadtxt(lines[3:], delimiter=",", comments=None, ndmin=2, encoding="utf-8")
        return SpectrometerReading(table[:, 0], table[:, 1:].T, **facts)
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError) as error:
        raise DataError(
            f"{path}: expected a reading of a spectrometer, got something else "
            f"({' '.join(str(error).split())}); the file was changed after the run"
        ) from None


def _spectrum(content: dict[str, Any]) -> Spectrum:
    sigma = content["sigma"]
    return Spectrum(
        str(content["name"]),
        np.array(content["wavelength_nm"], dtype=np.float64),
        np.array(content["value"], dtype=np.float64),
        None if sigma is None else np.array(sigma, dtype=np.float64),
    )


def lamp_calibration(measured: MeasuredSpectrum, lamp: Spectrum) -> Spectrum:
    """Return the absolute scale of a spectrometer from a standard lamp's certificate.

    The certificate of an incandescent standard has few wavelengths. Between them ln(E λ⁵) is
    interpolated linearly in 1/λ, which is exact for a radiator after Wien's law.

    Parameters
    ----------
    measured
        Corrected counts under the lamp, at the distance of the certificate.
    lamp
        Certified irradiance in W m⁻² nm⁻¹ over the wavelength in nm, with σ where it is known.

    Returns
    -------
    Spectrum
        Irradiance in W m⁻² nm⁻¹ of a light that gives one count per second, with σ, on the pixels
        within the certificate that saw the lamp; its table is what a rig file's `calibration`
        names.

    Raises
    ------
    DataError
        A pixel is saturated, the certificate is not above zero, or too few pixels saw the lamp.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import MeasuredSpectrum, Spectrum, lamp_calibration
    >>> grid_nm, dark = np.array([500.0, 600.0, 700.0]), np.zeros(3, dtype=bool)
    >>> measured = MeasuredSpectrum(grid_nm, np.array([100.0, 400.0, 900.0]), np.ones(3), dark, 0.5)
    >>> lamp = Spectrum("standard", grid_nm, np.array([0.01, 0.02, 0.03]))
    >>> lamp_calibration(measured, lamp).value.round(8).tolist()
    [5e-05, 2.5e-05, 1.667e-05]
    """
    ends = lamp.wavelength_nm[0], lamp.wavelength_nm[-1]
    within = (measured.wavelength_nm >= ends[0]) & (measured.wavelength_nm <= ends[1])
    if measured.saturated[within].any():
        raise DataError(
            "expected counts below saturation under the standard lamp, got saturated pixels; "
            "shorten the integration time"
        )
    if not (lamp.value > 0).all():
        raise DataError(f"{lamp.name}: expected an irradiance above zero at every wavelength")
    sigma = np.zeros_like(measured.counts) if measured.sigma is None else measured.sigma
    seen = within & (measured.counts > np.maximum(3 * sigma, 0.0))
    if seen.sum() < 2:
        raise DataError("expected light of the standard lamp, got too few pixels that saw any")
    grid_nm, rate = measured.wavelength_nm[seen], measured.counts[seen] / measured.integration_s
    irradiance = _between(lamp, grid_nm)
    value = irradiance / rate
    relative = sigma[seen] / measured.counts[seen]
    if lamp.sigma is not None:
        lamp_relative = np.interp(grid_nm, lamp.wavelength_nm, lamp.sigma / lamp.value)
        relative = np.hypot(relative, lamp_relative)
    return Spectrum(f"calibrated by {lamp.name}", grid_nm, value, value * relative)


def _between(lamp: Spectrum, wavelength_nm: FloatArray) -> FloatArray:
    """Return a lamp's irradiance between the wavelengths of its certificate."""
    known = lamp.wavelength_nm[::-1]
    logarithm = np.interp(
        1 / wavelength_nm, 1 / known, np.log(lamp.value[::-1] * (known / 1000) ** 5)
    )
    irradiance: FloatArray = np.exp(logarithm) / (wavelength_nm / 1000) ** 5
    return irradiance
