"""OpenEXR images: linear sRGB, and spectral ones that keep all that was rendered.

The spectral layout is that of A. Fichet, R. Pacanowski and A. Wilkie, An OpenEXR Layout for
Spectral Images, Journal of Computer Graphics Techniques 10(3), 2021, with R, G and B for other
programs. The edges of the bands, which the layout does not know, are an attribute.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.exr_file import read_exr, read_exr_header, write_exr
from labrig.material import read_spectral_image
from labrig.optics import XYZ_TO_SRGB, edges_from_centres
from labrig.reproduce.picture.display import tristimulus

Pixels = NDArray[np.float32]

#: Unit of the radiance as the layout writes it.
ABSOLUTE = "W.m^-2.sr^-1.nm^-1"
_EDGES_KEY = "bandEdgesNm"
#: Prefix of the attributes that hold texts, which no other attribute has.
_TEXT_PREFIX = "text."
#: R, G, B and white of sRGB, x and y of each.
_CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


@dataclass(frozen=True, eq=False)
class SpectralFrame:
    """A spectral image read from a file.

    Attributes
    ----------
    radiance
        Mean radiance in each band, shape (height, width, bands).
    edges_nm
        Edges of the bands in nm, shape (bands + 1,).
    units
        Unit of the radiance as the file gives it.
    texts
        Texts that were written with it, by their keywords.
    """

    radiance: Pixels
    edges_nm: FloatArray
    units: str
    texts: Mapping[str, str]


def write_spectral_exr(
    path: Path,
    radiance: ArrayLike,
    edges_nm: ArrayLike,
    texts: Mapping[str, str] | None = None,
    units: str = ABSOLUTE,
) -> None:
    """Write a spectral image, with nothing lost of its 32-bit numbers.

    Parameters
    ----------
    path
        Path of the file; it is replaced at once, so that no half of an image is left.
    radiance
        Mean radiance in each of two bands or more, shape (height, width, bands), top row first.
    edges_nm
        Rising edges of the bands in nm, shape (bands + 1,).
    texts
        Texts to be read back with it, by their keywords.
    units
        Unit of the radiance; `relative` where it has none.

    Raises
    ------
    UsageError
        The bands do not fit the image, or a radiance is not finite.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import read_spectral_exr, write_spectral_exr
    >>> glow = np.full((2, 3, 24), 0.1, np.float32)
    >>> write_spectral_exr(Path("glow.exr"), glow, np.linspace(300, 780, 25), {"time": "12 s"})
    >>> frame = read_spectral_exr(Path("glow.exr"))
    >>> bool((frame.radiance == glow).all()), frame.texts["time"], frame.edges_nm[:2].tolist()
    (True, '12 s', [300.0, 320.0])
    """
    pixels = np.asarray(radiance, dtype=np.float32)
    edges = np.asarray(edges_nm, dtype=np.float64)
    linear = _linear_srgb(path, tristimulus(pixels, edges))
    if len(edges) < 3:
        raise UsageError(f"{path}: expected two bands or more, got one")
    centres = (edges[1:] + edges[:-1]) / 2
    channels = {
        f"S0.{centre:.6f}nm".replace(".", ",").replace(",", ".", 1): pixels[..., band]
        for band, centre in enumerate(centres)
    }
    header = {
        "spectralLayoutVersion": "1.0",
        "emissiveUnits": units,
        "EV": 0.0,
        _EDGES_KEY: " ".join(repr(float(edge)) for edge in edges),
        **{f"{_TEXT_PREFIX}{key}": text for key, text in (texts or {}).items()},
    }
    _write(path, header, channels | linear)


def read_spectral_exr(path: Path) -> SpectralFrame:
    """Read a spectral image of light, from this or another program.

    Parameters
    ----------
    path
        Path of the file.

    Returns
    -------
    SpectralFrame
        The image; without the attribute of edges, they are half-way between the wavelengths.

    Raises
    ------
    UsageError
        The file cannot be read, is no spectral image of light or its edges are not those of its
        bands.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import read_spectral_exr, write_spectral_exr
    >>> write_spectral_exr(Path("two.exr"), np.ones((1, 1, 2)), [400, 500, 700], units="relative")
    >>> read_spectral_exr(Path("two.exr")).units
    'relative'
    """
    image = read_spectral_image(path)
    attributes = read_exr_header(path)
    if not len(image.emissive_nm):
        raise UsageError(f"{path}: expected light (channels S0.…), got a surface")
    edges = _edges(path, attributes.get(_EDGES_KEY), image.emissive_nm)
    texts = {
        key.removeprefix(_TEXT_PREFIX): str(value)
        for key, value in attributes.items()
        if key.startswith(_TEXT_PREFIX)
    }
    return SpectralFrame(image.emissive, edges, image.emissive_units, texts)


def write_linear_exr(path: Path, xyz: FloatArray) -> None:
    """Write X, Y, Z as linear sRGB, unclipped: colours out of gamut are negative in a channel.

    Parameters
    ----------
    path
        Path of the file; it is replaced at once.
    xyz
        X, Y, Z with Y in cd/m² or relative, shape (height, width, 3); (1, 1, 1) in the file is D65
        of luminance 1.

    Raises
    ------
    UsageError
        This is no image.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import read_linear_exr, write_linear_exr
    >>> write_linear_exr(Path("white.exr"), np.full((1, 1, 3), [95.0, 100.0, 108.9]))
    >>> read_linear_exr(Path("white.exr")).round(1).tolist()
    [[[95.0, 100.0, 108.9]]]
    """
    _write(path, {"whiteLuminance": 1.0}, _linear_srgb(path, np.asarray(xyz, dtype=np.float64)))


def read_linear_exr(path: Path) -> FloatArray:
    """Read an image in linear sRGB.

    Parameters
    ----------
    path
        Path of the file.

    Returns
    -------
    ndarray
        X, Y, Z, shape (height, width, 3).

    Raises
    ------
    UsageError
        The file cannot be read, lacks the channels R, G and B, or has pixels that are no number.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.reproduce import read_linear_exr, write_linear_exr
    >>> write_linear_exr(Path("black.exr"), np.zeros((2, 3, 3)))
    >>> read_linear_exr(Path("black.exr")).shape
    (2, 3, 3)
    """
    _, channels = read_exr(path)
    try:
        linear = np.stack([channels[name].pixels for name in "RGB"], axis=-1)
    except (ValueError, TypeError, KeyError):
        raise UsageError(
            f"{path}: expected an OpenEXR image with the channels R, G and B, got another or a "
            "broken one"
        ) from None
    if n_broken := int((~np.isfinite(linear)).any(axis=-1).sum()):
        raise UsageError(
            f"{path}: expected an image of numbers, got {n_broken} of {linear[..., 0].size} pixels "
            "that are infinite or no number; render it again"
        )
    return np.asarray(linear.astype(np.float64) @ np.linalg.inv(XYZ_TO_SRGB).T)


def _linear_srgb(path: Path, xyz: FloatArray) -> dict[str, Pixels]:
    """Return the channels R, G, B of X, Y, Z (height, width, 3)."""
    if xyz.ndim != 3 or not xyz.size:
        raise UsageError(f"{path}: expected an image of height and width, got {xyz.shape[:-1]}")
    linear = (xyz @ XYZ_TO_SRGB.T).astype(np.float32)
    return {name: linear[..., channel] for channel, name in enumerate("RGB")}


def _write(path: Path, header: Mapping[str, Any], channels: Mapping[str, Pixels]) -> None:
    write_exr(path, {"chromaticities": _CHROMATICITIES, **header}, channels)


def _edges(path: Path, written: object, centres_nm: FloatArray) -> FloatArray:
    """Return the edges that are written in an attribute, or those half-way between the centres."""
    if not isinstance(written, str):
        return edges_from_centres(centres_nm)
    try:
        edges = np.array(written.split(), dtype=np.float64)
    except ValueError:
        edges = np.zeros(0)
    is_fit = len(edges) == len(centres_nm) + 1 and (np.diff(edges) > 0).all()
    if not is_fit or not np.allclose((edges[1:] + edges[:-1]) / 2, centres_nm, rtol=0, atol=1e-5):
        raise UsageError(f"{path}: expected edges of its channels' bands, got '{written[:40]}'")
    return edges
