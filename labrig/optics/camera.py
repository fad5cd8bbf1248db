"""Spectral sensitivity of a camera's channels."""

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from labrig import shipped
from labrig.errors import UsageError

FloatArray = NDArray[np.float64]

CHANNELS = ("R", "G", "B")
#: What is called "a little below zero" in measured curves: noise of the measurement.
_NOISE_BELOW_ZERO = -0.05


@dataclass(frozen=True, eq=False)
class CameraResponse:
    """Relative spectral sensitivity of R, G and B.

    Parameters
    ----------
    name
        Maker and model.
    wavelength_nm
        Shape (n,), rising.
    sensitivity
        Shape (n, 3), the highest of all 1. How high the channels stand relative to each other is
        kept: it is what links raw numbers, not white balanced, to colours.
    """

    name: str
    wavelength_nm: FloatArray
    sensitivity: FloatArray

    def response(self, spectrum: FloatArray) -> FloatArray:
        """Camera values of a spectrum given at `wavelength_nm`, shape (3,), relative."""
        values: FloatArray = (spectrum * np.gradient(self.wavelength_nm)) @ self.sensitivity
        return values


def read_camera(name_or_path: str | os.PathLike[str]) -> CameraResponse:
    """The shipped camera of that name, or the one in a file of rawtoaces' format.

    Parameters
    ----------
    name_or_path
        Such as `canon_eos_5d_mark_ii`, or a path that ends in `.json`.

    Raises
    ------
    UsageError
        No such camera, or its file is malformed.
    """
    path = shipped.find("config/optics", "camera", name_or_path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: not JSON ({' '.join(str(error).split())})") from None
    try:
        return _camera(content, path.stem)
    except ValueError as error:
        raise UsageError(
            f"{path}: {error}; expected rawtoaces camera data, R, G and B under every wavelength "
            "in spectral_data.data.main"
        ) from None


def _camera(content: Any, file_name: str) -> CameraResponse:
    table = content
    for key in ("spectral_data", "data", "main"):
        if not isinstance(table, dict) or key not in table:
            raise ValueError(f"the key '{key}' is missing")
        table = table[key]
    channels = _entry(content["spectral_data"], "index", "main")
    if channels is not None and channels != list(CHANNELS):
        raise ValueError(f"the channels are {channels}")
    if not isinstance(table, dict) or len(table) < len(CHANNELS):
        raise ValueError("there are fewer than three wavelengths")
    try:
        wavelength_nm = np.array([float(key) for key in table])
        values = np.array(list(table.values()), dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError("something is not a number") from None
    if values.shape != (len(table), len(CHANNELS)):
        raise ValueError("some wavelength has not three values")
    order = np.argsort(wavelength_nm)
    wavelength_nm, values = wavelength_nm[order], values[order]
    if not (np.isfinite(values).all() and np.isfinite(wavelength_nm).all()):
        raise ValueError("some value is infinite or NaN")
    if (np.diff(wavelength_nm) <= 0).any():
        raise ValueError("a wavelength stands twice")
    if (values.max(axis=0) <= 0).any() or values.min() < _NOISE_BELOW_ZERO * values.max():
        raise ValueError("some channel is negative or zero throughout")
    if np.linalg.matrix_rank(values / values.max(axis=0), tol=1e-6) < len(CHANNELS):
        raise ValueError("two channels are the same")
    maker, model = (_entry(content, "header", key) for key in ("manufacturer", "model"))
    named = " ".join(str(part) for part in (maker, model) if part)
    return CameraResponse(named or file_name, wavelength_nm, values / values.max())


def _entry(content: dict[str, Any], section: str, key: str) -> Any:
    """`content[section][key]`, None if it is not there."""
    part = content.get(section)
    return part.get(key) if isinstance(part, dict) else None
