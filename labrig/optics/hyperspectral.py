"""Hyperspectral images: a spectrum in every pixel, from ENVI files or NumPy arrays.

ENVI is a text header beside a file of plain numbers. Source: NV5 Geospatial, *ENVI Header Files*.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.array_file import map_array, map_numbers, read_arrays
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.region import Region, region_pixels
from labrig.optics.spectrum import Spectrum

T = TypeVar("T")

#: Types of numbers by ENVI's `data type`.
_TYPES = {"1": "u1", "2": "i2", "3": "i4", "4": "f4", "5": "f8", "12": "u2", "13": "u4"}
#: Axes of the file by ENVI's `interleave`: lines, samples and bands.
_AXES = {"bsq": "bls", "bil": "lbs", "bip": "lsb"}
#: Nanometres by ENVI's `wavelength units`.
_UNITS_NM = {"nanometers": 1.0, "nanometer": 1.0, "nm": 1.0, "micrometers": 1e3, "um": 1e3,
             "unknown": 1.0, "": 1.0}  # fmt: skip
#: Endings of the file of numbers beside a header, in the order in which they are tried.
_BESIDE = ("", ".raw", ".img", ".dat", ".bsq", ".bil", ".bip")
#: Largest number of values, so that a wrong header does not fill the memory.
MAX_VALUES = 2_000_000_000


@dataclass(frozen=True, eq=False)
class HyperspectralCube:
    """An image with a spectrum in every pixel.

    Parameters
    ----------
    name
        Name of the file, for messages.
    wavelength_nm : ndarray, shape (bands,)
        Rising wavelengths in nm.
    values : ndarray, shape (lines, samples, bands)
        Light in each pixel, in any unit.

    Raises
    ------
    ValueError
        Shapes disagree, or wavelengths do not rise.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import HyperspectralCube
    >>> nm = np.array([400.0, 500.0, 600.0])
    >>> cube = HyperspectralCube("flat", nm, np.tile([1.0, 2.0, 3.0], (4, 6, 1)))
    >>> cube.spectrum((0.25, 0.25, 0.5, 0.5)).value.tolist()
    [1.0, 2.0, 3.0]
    """

    name: str
    wavelength_nm: FloatArray
    values: NDArray[Any]

    def __post_init__(self) -> None:
        if self.values.ndim != 3 or self.values.shape[2:] != self.wavelength_nm.shape:
            raise ValueError(
                f"expected lines x samples x {len(self.wavelength_nm)} bands, got an array of "
                f"shape {self.values.shape}"
            )
        if len(self.wavelength_nm) < 2 or not (np.diff(self.wavelength_nm) > 0).all():
            raise ValueError("expected two or more wavelengths that rise")

    def pixels(self, region: Region) -> FloatArray:
        """Return the spectra of a region's pixels, shape (pixels, bands).

        Parameters
        ----------
        region
            `[x, y, width, height]` in pixels, or all four as fractions of the image.

        Raises
        ------
        DataError
            A value in the region is not finite.
        """
        lines, samples, bands = self.values.shape
        x, y, wide, high = region_pixels(region, samples, lines)
        pixels = self.values[y : y + high, x : x + wide].reshape(-1, bands).astype(np.float64)
        if not np.isfinite(pixels).all():
            raise DataError(
                f"{self.name}: some value in the region is infinite or NaN; choose a region that "
                "the camera covers"
            )
        return pixels

    def spectrum(self, region: Region) -> Spectrum:
        """Return the mean spectrum of a region, and σ of the mean by the pixels' scatter.

        Parameters and errors are those of `pixels`.
        """
        pixels = self.pixels(region)
        sigma = pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels)) if len(pixels) > 1 else None
        return Spectrum(self.name, self.wavelength_nm, pixels.mean(axis=0), sigma)


def read_hyperspectral_cube(path: str | os.PathLike[str]) -> HyperspectralCube:
    """Read a hyperspectral image.

    Parameters
    ----------
    path
        ENVI header `NAME.hdr` with its numbers beside it (`NAME`, `NAME.raw`, `.img`, `.dat`,
        `.bsq`, `.bil` or `.bip`); or `NAME.npz` with the arrays `wavelength_nm` (bands,) and
        `values` (lines, samples, bands); or `NAME.npy` with the values, and `NAME.csv` beside it
        with one wavelength in nm a line. Large files of ENVI and `.npy` stay on the disk until a
        region is read.

    Returns
    -------
    HyperspectralCube
        The image; wavelengths in micrometres are converted.

    Raises
    ------
    UsageError
        There is no such file, or one beside it is missing.
    DataError
        The file is malformed, or its size does not fit.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.optics import read_hyperspectral_cube
    >>> nm = np.array([400.0, 500.0])
    >>> np.savez("cloth.npz", wavelength_nm=nm, values=np.ones((2, 3, 2)))
    >>> read_hyperspectral_cube("cloth.npz").values.shape
    (2, 3, 2)
    """
    path = Path(path)
    if not path.is_file():
        raise UsageError(f"{path}: expected a hyperspectral image, got no such file")
    readers = {".hdr": _read_envi, ".npz": _read_npz, ".npy": _read_npy}
    if path.suffix.lower() not in readers:
        raise UsageError(
            f"{path}: expected an ENVI header (.hdr), .npz or .npy, got '{path.suffix}'; convert it"
        )
    try:
        wavelength_nm, values = readers[path.suffix.lower()](path)
        return HyperspectralCube(path.name, wavelength_nm, values)
    except (ValueError, KeyError, OSError, EOFError, OverflowError) as error:
        raise DataError(
            f"{path}: expected a hyperspectral image, got something else "
            f"({' '.join(str(error).split())})"
        ) from None


def _data(read: Callable[[], T]) -> T:
    """Return what is read of an image; where that is refused, the data are at fault."""
    try:
        return read()
    except UsageError as error:
        raise DataError(str(error)) from None


def _read_npz(path: Path) -> tuple[FloatArray, NDArray[Any]]:
    arrays = _data(lambda: read_arrays(path))
    return np.asarray(arrays["wavelength_nm"], dtype=np.float64), arrays["values"]


def _read_npy(path: Path) -> tuple[FloatArray, NDArray[Any]]:
    beside = path.with_suffix(".csv")
    if not beside.is_file():
        raise UsageError(f"{path}: expected its wavelengths in the file {beside}, one a line")
    lines = [line for line in read_text(beside).split() if line[:1].isdigit()]
    return np.array([float(line) for line in lines]), _data(lambda: map_array(path))


def _read_envi(path: Path) -> tuple[FloatArray, NDArray[Any]]:
    header = _envi_header(read_text(path))
    size = {axis: int(header[key]) for axis, key in zip("lsb", _SIZES, strict=True)}
    offset = int(header.get("header offset", "0"))
    if min(size.values()) < 1 or offset < 0:
        raise ValueError(f"lines, samples and bands must be 1 or more, got {size}")
    number = size["l"] * size["s"] * size["b"]
    if number > MAX_VALUES:
        raise ValueError(f"{number} values are more than the {MAX_VALUES} that are read")
    kind, interleave = header["data type"], header["interleave"].lower()
    if kind not in _TYPES or interleave not in _AXES:
        raise ValueError(
            f"data type {kind}, interleave {interleave}; known are data types {', '.join(_TYPES)}, "
            f"interleaves {', '.join(_AXES)}"
        )
    order = ">" if header.get("byte order", "0") == "1" else "<"
    numbers = np.dtype(order + _TYPES[kind])
    data = _beside(path)
    axes = _AXES[interleave]
    shape = tuple(size[axis] for axis in axes)
    stored = _data(lambda: map_numbers(data, numbers, offset, shape))
    values = stored.transpose([axes.index(axis) for axis in "lsb"])
    return _envi_wavelengths_nm(header, size["b"]), values


_SIZES = ("lines", "samples", "bands")


def _envi_header(text: str) -> dict[str, str]:
    """Return the keys of a header, lower case, and their values without braces."""
    if not text.lstrip().startswith("ENVI"):
        raise ValueError("it does not begin with 'ENVI'")
    pairs = re.findall(r"^\s*([^=\n;]+?)\s*=\s*(\{[^}]*\}|[^\n]*)", text, re.MULTILINE)
    header = {key.lower(): value.strip().strip("{}").strip() for key, value in pairs}
    for key in (*_SIZES, "data type", "interleave", "wavelength"):
        if key not in header:
            raise ValueError(f"its header has no '{key}'")
    return header


def _envi_wavelengths_nm(header: dict[str, str], bands: int) -> FloatArray:
    unit = header.get("wavelength units", "").lower()
    if unit not in _UNITS_NM:
        raise ValueError(f"wavelengths in '{unit}' are not known, nanometers are")
    wavelengths = np.array(
        [float(cell) for cell in header["wavelength"].split(",") if cell.strip()]
    )
    if len(wavelengths) != bands:
        raise ValueError(f"{bands} bands, but {len(wavelengths)} wavelengths")
    return wavelengths * _UNITS_NM[unit]


def _beside(path: Path) -> Path:
    """Return the file of numbers that belongs to a header."""
    for ending in _BESIDE:
        if (data := path.with_suffix(ending)).is_file():
            return data
    raise UsageError(
        f"{path}: expected its numbers beside it, in {path.with_suffix('.raw').name} or "
        f"{path.stem}; put the file there"
    )
