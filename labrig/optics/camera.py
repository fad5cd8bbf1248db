"""Spectral sensitivity of a camera's channels."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from labrig import resources
from labrig.errors import UsageError
from labrig.optics.curve_file import CurveFile, checked, read_curve_file
from labrig.optics.piecewise import FloatArray, band_means
from labrig.optics.spectrum import check_curve

CHANNELS = ("R", "G", "B")
MONOCHROME = ("L",)
#: What is called "a little below zero" in measured curves: noise of the measurement.
_NOISE_BELOW_ZERO = -0.05
#: Suffixes of tables; names shipped with labrig have none.
_TABLES = (".csv", ".dat", ".txt")


@dataclass(frozen=True, eq=False)
class CameraResponse:
    """Relative spectral sensitivity of R, G and B, or of a monochrome camera's one channel.

    Parameters
    ----------
    name
        Maker and model.
    wavelength_nm
        Shape (n,), rising.
    sensitivity
        Shape (n, channels), the highest of all 1. How high the channels stand relative to each
        other is kept: it is what links raw numbers, not white balanced, to colours. Straight lines
        in between, zero outside.
    channels
        Their names.
    """

    name: str
    wavelength_nm: FloatArray
    sensitivity: FloatArray
    channels: tuple[str, ...] = CHANNELS

    def response(self, spectrum: FloatArray) -> FloatArray:
        """Camera values of a spectrum given at `wavelength_nm`, shape (channels,), relative."""
        values: FloatArray = (spectrum * np.gradient(self.wavelength_nm)) @ self.sensitivity
        return values

    def at(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Sensitivity at (q,) wavelengths, shape (q, channels)."""
        wanted = np.asarray(wavelength_nm, dtype=np.float64)
        return np.stack(
            [
                np.interp(wanted, self.wavelength_nm, column, left=0.0, right=0.0)
                for column in self.sensitivity.T
            ],
            axis=1,
        )

    def in_bands(self, edges_nm: ArrayLike) -> FloatArray:
        """Mean over each band between neighbouring `edges_nm`, shape (edges − 1, channels)."""
        return band_means(self.wavelength_nm, self.sensitivity, edges_nm)


def read_camera(name_or_path: str | os.PathLike[str]) -> CameraResponse:
    """The shipped camera of that name, or the one in a file.

    Parameters
    ----------
    name_or_path
        Such as `canon_eos_5d_mark_ii`, or a path: rawtoaces' JSON, or a table in CSV with
        `wavelength_nm,R,G,B` or, as Jiang et al. have it, those four columns without a header.

    Raises
    ------
    UsageError
        No such camera, or its file is malformed.
    """
    file = read_curve_file(camera_path(name_or_path))
    if set(file.curves) != set(CHANNELS):
        raise UsageError(
            f"{file.path}: expected the channels R, G and B, the channels are "
            f"{', '.join(list(file.curves)[:6])}; a monochrome camera is read as such"
        )
    return checked(file.path, lambda known: _camera(known, CHANNELS), file)


def read_monochrome_camera(
    path: str | os.PathLike[str], curve: str | None = None
) -> CameraResponse:
    """A camera without colours, from a file as `read_spectrum` takes it.

    Raises
    ------
    UsageError
        The file or the name of the curve is no good.
    """
    file = read_curve_file(path)
    name, columns = file.pick(curve)
    one = CurveFile(file.path, file.title, {name: columns})
    return checked(file.path, lambda known: _camera(known, (name,)), one)


def read_sound_curves(
    name_or_path: str | os.PathLike[str], names: Sequence[str] | None = None
) -> CurveFile:
    """A file with the curves of some names, all of them sound.

    Raises
    ------
    UsageError
        No such file or curve, or a curve that makes no sense.
    """
    file = read_curve_file(camera_path(name_or_path))
    if names:
        file = replace(file, curves=dict(file.pick(name) for name in names))
    for name, curve in file.curves.items():
        checked(f"{file.path}: {name}", lambda c: check_curve(*c), curve)
    return file


def camera_path(name_or_path: str | os.PathLike[str]) -> Path:
    """File of a shipped camera, or the path as given."""
    path = Path(name_or_path)
    if path.suffix.lower() in _TABLES:
        return path
    return resources.find("config/optics", "camera", name_or_path)


def _camera(file: CurveFile, names: tuple[str, ...]) -> CameraResponse:
    curves = [file.curves[name] for name in names]
    wavelength_nm, values = curves[0].wavelength_nm, np.stack([c.value for c in curves], axis=1)
    check_curve(wavelength_nm, values, None)
    if len(wavelength_nm) < 3:
        raise ValueError("there are fewer than three wavelengths")
    if (values.max(axis=0) <= 0).any() or values.min() < _NOISE_BELOW_ZERO * values.max():
        raise ValueError("some channel is negative or zero throughout")
    if np.linalg.matrix_rank(values / values.max(axis=0), tol=1e-6) < len(names):
        raise ValueError("two channels are the same")
    channels = CHANNELS if names == CHANNELS else MONOCHROME
    return CameraResponse(file.title, wavelength_nm, values / values.max(), channels)
