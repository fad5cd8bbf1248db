"""Spectral and bispectral OpenEXR images.

The layout is that of A. Fichet, R. Pacanowski and A. Wilkie, An OpenEXR Layout for Spectral
Images, Journal of Computer Graphics Techniques 10(3), 2021: channels `S0.<nm>nm` of light,
`T.<nm>nm` of reflectance, `T.<in>nm.<out>nm` of re-radiation per band, with decimal commas; R, G
and B for other programs; the attributes `spectralLayoutVersion`, `EV` and, of light,
`emissiveUnits`.
"""

import itertools
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.exr_file import read_exr, read_exr_header, write_exr as write_exr_file
from labrig.material.reradiation.formats.text_rows import (
    check_fractions,
    check_is_absolute,
    check_wavelengths,
    one_line,
    shown,
)
from labrig.material.reradiation.matrix import SAME_NM, ReradiationMatrix
from labrig.optics import CIE_1931, Spectrum, edges_from_centres, illuminant, observer

Pixels = NDArray[np.float32]

VERSION = "1.0"
_VERSION_KEY = "spectralLayoutVersion"
_UNITS_KEY = "emissiveUnits"

_WAVELENGTH = r"(\d+(?:,\d*)?(?:[Ee][+-]?\d+)?)(da|[YZEPTGMkhdcmunp])?(m|Hz)"
_CHANNEL = re.compile(rf"(S[0-3]|T)\.{_WAVELENGTH}(?:\.{_WAVELENGTH})?")
_LAYER = re.compile(r"(S[0-3]|T)\.")
_PREFIXES = dict(
    zip(
        ("Y", "Z", "E", "P", "T", "G", "M", "k", "h", "da", "", "d", "c", "m", "u", "n", "p"),
        (24, 21, 18, 15, 12, 9, 6, 3, 2, 1, 0, -1, -2, -3, -6, -9, -12),
        strict=True,
    )
)
_LIGHT_M_PER_S = 299_792_458.0


@dataclass(frozen=True, eq=False)
class SpectralImage:
    """A spectral image; of what is not in it, the wavelengths have shape (0,).

    Parameters
    ----------
    path
        Path of the file.
    name
        Name in the file; else the file's name.
    emissive_nm
        Rising wavelengths of the light in nm, shape (k,).
    emissive
        Light of each pixel (Stokes component S0), shape (height, width, k).
    emissive_units
        Unit of the light, as the file gives it.
    reflective_nm
        Rising wavelengths of the reflectance in nm, shape (n,).
    reflective
        Radiance factor of each pixel without re-radiation, shape (height, width, n).
    pairs_nm
        Wavelengths of incident light and of what comes back in nm, shape (p, 2).
    bispectral
        Fraction of the light in each band that comes back in the other, shape (height, width, p).

    Raises
    ------
    ValueError
        Wavelengths of the light do not rise, or are not plausible.
    """

    path: Path
    name: str
    emissive_nm: FloatArray
    emissive: Pixels
    emissive_units: str
    reflective_nm: FloatArray
    reflective: Pixels
    pairs_nm: FloatArray
    bispectral: Pixels

    def __post_init__(self) -> None:
        if len(self.emissive_nm):
            check_wavelengths(self.emissive_nm)

    def spectrum(self, pixel: tuple[int, int] | None = None) -> Spectrum:
        """Return the light of a pixel in the unit of the image.

        Parameters
        ----------
        pixel
            Column and row; not needed where all pixels are the same.

        Raises
        ------
        UsageError
            The image has no light, no such pixel, or several.
        """
        if not len(self.emissive_nm):
            raise UsageError(f"{self.path}: expected light (channels S0.…), got a surface")
        value = self._at(self.emissive, pixel)
        if not np.isfinite(value).all():
            raise UsageError(f"{self.path}: the light of the pixel is not finite")
        return Spectrum(self.name, self.emissive_nm, value)

    def matrix(self, pixel: tuple[int, int] | None = None) -> ReradiationMatrix:
        """Return reflectance and re-radiation of a pixel.

        A reflective pixel re-radiates nothing. Re-radiation at shorter wavelengths than those of
        the light is 0 where the image leaves it out, as the layout may; at longer ones it was not
        measured.

        Parameters
        ----------
        pixel
            Column and row; not needed where all pixels are the same.

        Raises
        ------
        UsageError
            The image has no surface, no such pixel, or several; or its numbers are absurd.
        """
        if not len(self.reflective_nm) and not len(self.pairs_nm):
            raise UsageError(
                f"{self.path}: expected a surface (channels T.…), got light; "
                "read it as a spectral image"
            )
        reflectance = self._at(self.reflective, pixel)
        fractions = self._at(self.bispectral, pixel)
        try:
            for values in (reflectance, fractions):
                check_fractions(values.tolist(), "the pixel")
            input_nm, output_nm = self._grids()
            for nm in (input_nm, output_nm):
                check_wavelengths(nm)
            return self._placed(input_nm, output_nm, reflectance, fractions)
        except ValueError as error:
            raise UsageError(f"{self.path}: {error}") from None

    def _at(self, values: Pixels, pixel: tuple[int, int] | None) -> FloatArray:
        """Return the numbers of a pixel, or of all pixels where they are the same."""
        height, width = values.shape[:2]
        if pixel is None:
            first = values[0, 0]
            if not np.array_equal(values, np.broadcast_to(first, values.shape), equal_nan=True):
                raise UsageError(
                    f"{self.path}: expected an image of one colour, got {width} × {height} "
                    "different pixels; choose one by column and row"
                )
            return _float64(first)
        column, row = pixel
        if not (0 <= column < width and 0 <= row < height):
            raise UsageError(
                f"{self.path}: expected a pixel in {width} × {height}, got column {column}, "
                f"row {row}"
            )
        return _float64(values[row, column])

    def _grids(self) -> tuple[FloatArray, FloatArray]:
        """Return wavelengths of input and output, not all of which a triangle of pairs names."""
        inputs, outputs = (np.unique(self.pairs_nm[:, column]) for column in (0, 1))
        is_square = np.isin(self.pairs_nm, self.reflective_nm).all()
        if is_square and (self.pairs_nm[:, 1] > self.pairs_nm[:, 0]).all():
            return self.reflective_nm, self.reflective_nm
        return inputs, np.union1d(outputs, self.reflective_nm)

    def _placed(
        self,
        input_nm: FloatArray,
        output_nm: FloatArray,
        reflectance: FloatArray,
        fractions: FloatArray,
    ) -> ReradiationMatrix:
        shape = len(output_nm), len(input_nm)
        left_out = np.nan if len(self.pairs_nm) else 0.0
        table = np.where(output_nm[:, np.newaxis] > input_nm + SAME_NM, left_out, np.zeros(shape))
        rows = np.searchsorted(output_nm, self.pairs_nm[:, 1])
        columns = np.searchsorted(input_nm, self.pairs_nm[:, 0])
        table[rows, columns] = fractions
        whole = np.full(len(output_nm), np.nan)
        whole[np.searchsorted(output_nm, self.reflective_nm)] = reflectance
        width_nm = np.diff(edges_from_centres(output_nm))[:, np.newaxis]
        return ReradiationMatrix(self.name, input_nm, output_nm, whole, table / width_nm)


def read_spectral_image(path: str | os.PathLike[str]) -> SpectralImage:
    """Read a spectral or bispectral OpenEXR image.

    The layout is that of Fichet, Pacanowski and Wilkie, An OpenEXR Layout for Spectral Images,
    Journal of Computer Graphics Techniques 10(3), 2021.

    Parameters
    ----------
    path
        Path of an image of one part, with the layout's attributes.

    Returns
    -------
    SpectralImage
        Light, reflectance and re-radiation of all pixels in 32-bit numbers. Of polarised light, it
        is the whole (S0).

    Raises
    ------
    UsageError
        The file cannot be read, is no image, or lacks the layout's attributes or channels.

    Examples
    --------
    >>> from labrig.material import read_reradiation, read_spectral_image, write_reradiation
    >>> write_reradiation("paper.exr", read_reradiation("paper.csv"))
    >>> image = read_spectral_image("paper.exr")
    >>> image.reflective.shape, image.bispectral.shape
    ((1, 1, 41), (1, 1, 1968))
    >>> image.matrix().name
    'yellow paper'
    """
    image_path = Path(path)
    try:
        _check_header(read_exr_header(image_path))
        return _image(image_path, *read_exr(image_path))
    except ValueError as error:
        raise UsageError(f"{image_path}: {error}") from None


def _image(path: Path, header: Mapping[str, Any], channels: Mapping[str, Any]) -> SpectralImage:
    spectral = [
        _SpectralChannel(match[1], _wavelengths(match), _pixels(channels[name]))
        for name in channels
        if (match := _matched(name)) is not None
    ]
    if not spectral:
        raise ValueError("expected spectral channels such as T.500,000000nm, got none")
    emissive_nm, emissive = _stacked(spectral, "S0", 1)
    reflective_nm, reflective = _stacked(spectral, "T", 1)
    pairs_nm, bispectral = _stacked(spectral, "T", 2)
    if len(emissive_nm) and not isinstance(header.get(_UNITS_KEY), str):
        raise ValueError(f"expected the attribute {_UNITS_KEY} with channels of light, got none")
    return SpectralImage(
        path,
        _name(header, path.stem),
        emissive_nm[:, 0],
        emissive,
        str(header.get(_UNITS_KEY, "")),
        reflective_nm[:, 0],
        reflective,
        pairs_nm,
        bispectral,
    )


@dataclass(frozen=True, eq=False)
class _SpectralChannel:
    """A channel: its layer, one wavelength or those of the light and of what comes back, pixels."""

    layer: str
    nm: tuple[float, ...]
    pixels: Pixels


def _float64(values: Pixels) -> FloatArray:
    # Broken files have NaN that signal.
    with np.errstate(invalid="ignore"):
        return values.astype(np.float64)


def _pixels(channel: Any) -> Pixels:
    if channel.pixels is None or channel.pixels.ndim != 2:
        raise ValueError("the image's pixels cannot be read; the file is cut or broken")
    if (channel.xSampling, channel.ySampling) != (1, 1):
        raise ValueError("expected channels of all pixels, got one of fewer")
    pixels: Pixels = channel.pixels.astype(np.float32)
    if np.isinf(pixels).any():
        raise ValueError("some pixel is infinite")
    return pixels


def _matched(name: str) -> re.Match[str] | None:
    """Return the parts of the name of a spectral channel, None of another."""
    match = _CHANNEL.fullmatch(name)
    if match is None and _LAYER.match(name):
        raise ValueError(f"expected channels such as T.500,000000nm, got {shown(name)}")
    return match


def _stacked(
    channels: list[_SpectralChannel], layer: str, dimensions: int
) -> tuple[FloatArray, Pixels]:
    """Return the wavelengths (k, dimensions) of a layer, rising, and its pixels (h, w, k)."""
    found = [one for one in channels if one.layer == layer and len(one.nm) == dimensions]
    found.sort(key=lambda channel: channel.nm)
    nm = np.array([channel.nm for channel in found], dtype=np.float64).reshape(-1, dimensions)
    if len(np.unique(nm, axis=0)) != len(nm):
        raise ValueError("two channels have the same wavelength")
    if not found:
        return nm, np.zeros((*channels[0].pixels.shape, 0), np.float32)
    return nm, np.stack([channel.pixels for channel in found], axis=-1)


def _check_header(header: Mapping[str, Any]) -> None:
    version = header.get(_VERSION_KEY)
    if not isinstance(version, str):
        raise ValueError(f"expected the attribute {_VERSION_KEY} of a spectral image, got none")
    if version != VERSION:
        raise ValueError(f"expected {_VERSION_KEY} {VERSION}, got {shown(version)}")


def _wavelengths(match: re.Match[str]) -> tuple[float, ...]:
    ends = [match.groups()[k : k + 3] for k in (1, 4)]
    return tuple(_nanometres(end[0], end[1] or "", end[2]) for end in ends if end[0])


def _nanometres(value: str, prefix: str, unit: str) -> float:
    """Return the wavelength in nm of metres or Hz with an SI prefix."""
    exponent = _PREFIXES[prefix]
    number = float(value.replace(",", "."))
    if unit == "m":
        # Of nm the power is 0: the number stays exact.
        nm = number * 10.0 ** (exponent + 9)
    else:
        nm = _LIGHT_M_PER_S / (number * 10.0**exponent) * 1e9 if number else math.inf
    if not math.isfinite(nm):
        raise ValueError(f"expected channels of wavelengths, got {value}{prefix}{unit}")
    # Two ways to write one wavelength are one number.
    return round(nm, 6)


def _name(header: Mapping[str, Any], stem: str) -> str:
    name = header.get("name")
    return one_line(name) or stem if isinstance(name, str) else stem


def write_exr(path: Path, matrix: ReradiationMatrix) -> None:
    """Write a bispectral image of one pixel, in the layout's channels and attributes.

    Where input and output have the same wavelengths and nothing comes back at shorter ones than
    those of the light, the pairs are the triangle that the layout's own programs expect; else all
    are written.

    Raises
    ------
    ValueError
        The re-radiation is relative, or the wavelengths are closer than 1e-6 nm.
    DiskError
        The file cannot be written.
    """
    check_is_absolute(matrix)
    input_nm, output_nm = (np.round(nm, 6) for nm in (matrix.input_nm, matrix.output_nm))
    for nm in (input_nm, output_nm):
        check_wavelengths(nm)
    channels = {name: np.float32(value) for name, value in _rgb(matrix).items()}
    for nm, value in zip(output_nm, matrix.reflectance, strict=True):
        if not np.isnan(value):
            channels[f"T.{_channel(nm)}"] = np.float32(value)
    fractions = matrix.reradiation * matrix.output_width_nm[:, np.newaxis]
    check_fractions(fractions.ravel().tolist(), "the matrix")
    is_triangle = (
        np.array_equal(input_nm, output_nm)
        and not np.isnan(matrix.reflectance).any()
        and not fractions[~matrix.is_stokes].any()
    )
    for row, column in itertools.product(range(len(output_nm)), range(len(input_nm))):
        is_same = input_nm[column] == output_nm[row] and not fractions[row, column]
        if matrix.is_stokes[row, column] or not (is_triangle or is_same):
            pair = f"T.{_channel(input_nm[column])}.{_channel(output_nm[row])}"
            channels[pair] = np.float32(fractions[row, column])
    header = {
        "EV": 0.0,
        _VERSION_KEY: VERSION,
    }
    if matrix.name:
        header["name"] = one_line(matrix.name)
    pixels = {name: np.full((1, 1), value, np.float32) for name, value in channels.items()}
    write_exr_file(path, header, pixels)


def _channel(nm: float) -> str:
    return f"{nm:.6f}nm".replace(".", ",")


def _rgb(matrix: ReradiationMatrix) -> dict[str, float]:
    """Return linear sRGB under D65 for programs that show no spectra, a perfect white (1, 1, 1)."""
    eye, light = observer(CIE_1931), illuminant("D65")
    edges, width_nm = matrix.output_edges_nm, matrix.output_width_nm
    response = np.stack(
        [Spectrum("", eye.wavelength_nm, values).in_bands(edges) for values in eye.functions.T]
    )
    white = response[1] @ (light.in_bands(edges) * width_nm)
    seen = response @ (np.nan_to_num(matrix.under(light).total.value) * width_nm)
    if white <= 0:
        return dict.fromkeys("RGB", 0.0)
    to_rgb = colour_science.load().RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB
    return dict(zip("RGB", np.maximum(to_rgb @ (seen / white), 0.0).tolist(), strict=True))
