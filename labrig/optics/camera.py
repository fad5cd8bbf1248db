"""Spectral sensitivity of a camera's channels, and the cameras whose curves are shipped."""

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.optics.curve_file import CurveFile, checked, read_curve_file
from labrig.optics.piecewise import band_means
from labrig.optics.spectrum import check_curve

#: Folder of the files, JSON as rawtoaces writes it.
FOLDER = "config/optics/cameras"
#: Names of the same model elsewhere in the world.
OTHER_NAMES = {
    "EOS 100D": ("EOS Rebel SL1", "EOS Kiss X7"),
    "EOS 200D": ("EOS Rebel SL2", "EOS Kiss X9"),
    "EOS 200D II": ("EOS 250D", "EOS Rebel SL3", "EOS Kiss X10"),
    "EOS 600D": ("EOS Rebel T3i", "EOS Kiss X5"),
    "EOS R5m2": ("EOS R5 Mark II",),
    "EOS R6m2": ("EOS R6 Mark II",),
    "Digital Rebel XTi": ("EOS Digital Rebel XTi", "EOS 400D Digital", "EOS Kiss Digital X"),
}
#: Words of makers' names that are no part of it.
COMPANY = {"co", "company", "corp", "corporation", "inc", "ltd"}


@dataclass(frozen=True)
class ShippedCamera:
    """A camera whose curves are shipped.

    Attributes
    ----------
    name
        Name of the shipped file, for rig files and commands.
    maker, model
        Names in the file's header.
    path
        Path of the file.
    """

    name: str
    maker: str
    model: str
    path: Path

    def is_called(self, camera: str) -> bool:
        """True if the camera calls itself so, with or without its maker."""
        maker, asked = _words(self.maker), _words(camera)
        models = {_key(_words(model)) for model in (self.model, *OTHER_NAMES.get(self.model, ()))}
        while asked[: len(maker)] == maker:
            asked = asked[len(maker) :]
        return _key(asked) in models


@cache
def shipped_cameras() -> tuple[ShippedCamera, ...]:
    """Return the cameras whose curves are shipped, by name.

    Returns
    -------
    tuple of ShippedCamera
        Name, maker, model and file of each.

    Examples
    --------
    >>> from labrig.optics import shipped_cameras
    >>> [camera.name for camera in shipped_cameras() if camera.maker == "Fujifilm"]
    ['fujifilm_gfx_100', 'fujifilm_x_t3', 'fujifilm_x_t4']
    """
    cameras = []
    for name, path in resources.names(FOLDER).items():
        header = json.loads(read_text(path))["header"]
        cameras.append(ShippedCamera(name, header["manufacturer"], header["model"], path))
    return tuple(cameras)


def shipped_camera(camera: str) -> ShippedCamera | None:
    """Return the shipped camera that calls itself so, as in EXIF or on USB.

    Parameters
    ----------
    camera
        Maker and model, or the model alone, in any case.

    Returns
    -------
    ShippedCamera or None
        None if no curves of that model are shipped.

    Examples
    --------
    >>> from labrig.optics import shipped_camera
    >>> [
    ...     shipped_camera(text).name
    ...     for text in ("Canon EOS REBEL T3i", "NIKON CORPORATION NIKON D850", "SONY ILCE-7M3")
    ... ]
    ['canon_eos_600d', 'nikon_d850', 'sony_ilce_7m3']
    >>> shipped_camera("Canon EOS 5D Mark VI") is None
    True
    """
    return next((one for one in shipped_cameras() if one.is_called(camera)), None)


def _words(text: str) -> list[str]:
    words: list[str] = re.findall(r"[a-z0-9]+", text.casefold())
    return [word for word in words if word not in COMPANY]


def _key(words: list[str]) -> str:
    return "".join(words)


CHANNELS = ("R", "G", "B")
MONOCHROME = ("L",)
#: File of curves in the result of a run of `camera_curves`.
CURVES_FILE = "curves.csv"
#: Lowest value of a measured curve, relative to its maximum, that counts as noise.
_NOISE_BELOW_ZERO = -0.05
#: Suffixes of tables; names of shipped cameras have none.
_TABLES = (".csv", ".dat", ".txt")


@dataclass(frozen=True, eq=False)
class CameraResponse:
    """Relative spectral sensitivity of R, G and B, or of a monochrome camera's one channel.

    Parameters
    ----------
    name
        Maker and model of the camera.
    wavelength_nm
        Rising wavelengths in nm, shape (n,).
    sensitivity
        Sensitivities, shape (n, channels), the highest value of all 1, piecewise linear in between
        and zero outside. The ratios between channels are kept: they link raw signals, which are not
        white balanced, to colours.
    channels
        Names of the channels.
    sigma
        One standard deviation of the sensitivities, shape (n, channels), where it is known; a
        factor common to all is not in it.
    """

    name: str
    wavelength_nm: FloatArray
    sensitivity: FloatArray
    channels: tuple[str, ...] = CHANNELS
    sigma: FloatArray | None = None

    @property
    def has_ratios(self) -> bool:
        """Whether the ratios between channels are known: not if each was scaled to 1."""
        return len(self.channels) == 1 or bool((self.sensitivity.max(axis=0) < 1).any())

    def response(self, spectrum: FloatArray) -> FloatArray:
        """Return the relative signal of a spectrum given at `wavelength_nm`, shape (channels,)."""
        seen = spectrum[:, np.newaxis] * self.sensitivity
        return np.asarray(np.trapezoid(seen, self.wavelength_nm, axis=0))

    def at(self, wavelength_nm: ArrayLike) -> FloatArray:
        """Return the sensitivity at (q,) wavelengths in nm, shape (q, channels)."""
        target_nm = np.asarray(wavelength_nm, dtype=np.float64)
        return np.stack(
            [
                np.interp(target_nm, self.wavelength_nm, column, left=0.0, right=0.0)
                for column in self.sensitivity.T
            ],
            axis=1,
        )

    def in_bands(self, edges_nm: ArrayLike) -> FloatArray:
        """Average the sensitivity between neighbouring `edges_nm`, shape (edges − 1, channels)."""
        return band_means(self.wavelength_nm, self.sensitivity, edges_nm)


def read_camera(name_or_path: str | os.PathLike[str]) -> CameraResponse:
    """Read the spectral sensitivity of a colour camera, by its shipped name or from a file.

    Parameters
    ----------
    name_or_path
        Name of a shipped camera such as `canon_eos_5d_mark_ii`, maker and model as the camera
        states them, such as `Canon EOS 5D Mark II`, or the folder of a run of `camera_curves`, or
        the path of a file: JSON as rawtoaces writes
        it, or a CSV table with the columns `wavelength_nm,R,G,B`, with σ in `R_sigma` … where it is
        known, or the first four columns without a header (Jiang et al. 2013).

    Returns
    -------
    CameraResponse
        Relative sensitivities of R, G and B; the highest value of all is 1.

    Raises
    ------
    UsageError
        There is no such camera, or its file is malformed.

    Examples
    --------
    >>> import labrig
    >>> camera = labrig.read_camera("canon_eos_5d_mark_ii")
    >>> camera.name
    'Canon EOS 5D Mark II'
    >>> camera.sensitivity.max(axis=0).round(2).tolist()
    [0.54, 1.0, 0.9]
    >>> peak = camera.sensitivity.argmax(axis=0)
    >>> camera.wavelength_nm[peak].tolist()
    [600.0, 520.0, 460.0]
    """
    file = read_curve_file(camera_path(name_or_path))
    if set(file.curves) != set(CHANNELS):
        raise UsageError(
            f"{file.path}: expected the channels R, G and B, the channels are "
            f"{', '.join(list(file.curves)[:6])}; a monochrome camera is read as such"
        )
    return checked(file.path, lambda curve_file: _camera(curve_file, CHANNELS), file)


def read_monochrome_camera(
    path: str | os.PathLike[str], curve: str | None = None
) -> CameraResponse:
    r"""Read the spectral sensitivity of a monochrome camera from a file.

    Parameters
    ----------
    path
        Path of a curve file in any format of `read_curve_file`.
    curve
        Name of the curve in the file; not needed where there is only one.

    Returns
    -------
    CameraResponse
        Relative sensitivity of the channel `L`, with maximum 1.

    Raises
    ------
    UsageError
        The file is malformed, or it has no curve of that name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.optics import read_monochrome_camera
    >>> _ = Path("mono.csv").write_text("wavelength_nm,value\n400,0.2\n550,0.6\n700,0.3\n")
    >>> camera = read_monochrome_camera("mono.csv")
    >>> camera.channels, camera.at([550, 625]).round(2).ravel().tolist()
    (('L',), [1.0, 0.75])
    """
    file = read_curve_file(path)
    name, columns = file.pick(curve)
    selected = CurveFile(file.path, file.title, {name: columns})
    return checked(file.path, lambda curve_file: _camera(curve_file, (name,)), selected)


def read_checked_curves(
    name_or_path: str | os.PathLike[str], names: Sequence[str] | None = None
) -> CurveFile:
    """Read curves from a file and check each of them.

    Parameters
    ----------
    name_or_path
        Name of a shipped camera, or the path of a curve file.
    names
        Names of the curves to keep; all curves by default.

    Returns
    -------
    CurveFile
        The file with the selected curves.

    Raises
    ------
    UsageError
        There is no such file or curve, or a curve has wavelengths that do not rise or values that
        are not finite.

    Examples
    --------
    >>> from labrig.optics import read_checked_curves
    >>> file = read_checked_curves("canon_eos_5d_mark_ii", ["G"])
    >>> list(file.curves), len(file.curves["G"].wavelength_nm)
    (['G'], 81)
    """
    file = read_curve_file(camera_path(name_or_path))
    if names:
        file = replace(file, curves=dict(file.pick(name) for name in names))
    for name, curve in file.curves.items():
        checked(f"{file.path}: {name}", lambda c: check_curve(*c), curve)
    return file


def camera_path(name_or_path: str | os.PathLike[str]) -> Path:
    """Return the file of a shipped camera, by its name or its own, or that of a path.

    Raises
    ------
    UsageError
        There is no such camera, or a folder that is no processed run of `camera_curves`.
    """
    path = Path(name_or_path)
    if path.is_dir() and len(path.parts) > 1:
        found = next(iter([*path.glob(f"result/{CURVES_FILE}"), *path.glob(CURVES_FILE)]), None)
        if found is None:
            raise UsageError(
                f"{path}: expected a run of camera_curves with {CURVES_FILE} in its result, found "
                "none; process it first, or name the file of the curves itself"
            )
        return found
    if path.suffix.lower() in _TABLES:
        return path
    if len(path.parts) == 1 and (shipped := shipped_camera(str(path))):
        return shipped.path
    return resources.find(FOLDER, "camera", name_or_path)


def _camera(file: CurveFile, names: tuple[str, ...]) -> CameraResponse:
    """Check curves and scale them to a maximum of 1."""
    curves = [file.curves[name] for name in names]
    wavelength_nm, values = curves[0].wavelength_nm, np.stack([c.value for c in curves], axis=1)
    sigmas = [curve.sigma for curve in curves if curve.sigma is not None]
    sigma = np.stack(sigmas, axis=1) if len(sigmas) == len(curves) else None
    check_curve(wavelength_nm, values, sigma)
    if len(wavelength_nm) < 3:
        raise ValueError("there are fewer than three wavelengths")
    if (values.max(axis=0) <= 0).any() or values.min() < _NOISE_BELOW_ZERO * values.max():
        raise ValueError("some channel is negative or zero throughout")
    if np.linalg.matrix_rank(values / values.max(axis=0), tol=1e-6) < len(names):
        raise ValueError("two channels are the same")
    channels = CHANNELS if names == CHANNELS else MONOCHROME
    scale = float(values.max())
    relative = None if sigma is None else sigma / scale
    return CameraResponse(file.title, wavelength_nm, values / scale, channels, relative)
