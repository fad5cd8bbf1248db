"""The smoothest spectrum of a colour that is nowhere negative.

Many spectra have one colour. Of those on a grid the one of least squared second differences is
taken (Smits, *An RGB-to-spectrum conversion for reflectances*, 1999, takes first differences of
reflectances). It is a choice, no measurement.
"""

from functools import cache

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.nonnegative import nonnegative_least_squares
from labrig.optics import CIE_1931, observer

#: Grid of the primaries' spectra, over which the observer sees.
PRIMARIES_NM = np.arange(390.0, 721.0, 5.0)
#: Weight of the colour over that of smoothness.
COLOUR_WEIGHT = 1e4
#: Error of a colour, relative to its luminance, up to which a spectrum is said to have it.
SAME_COLOUR = 2e-3

XYZ_OF_RGB = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)


def smooth_spectrum(rgb: FloatArray, colours_of_bands: FloatArray) -> FloatArray:
    """Return the smoothest non-negative spectrum of a colour.

    Parameters
    ----------
    rgb
        Colour in linear sRGB, shape (3,), or other sums over the bands, shape (n,); negative values
        are outside of sRGB, but may be seen.
    colours_of_bands
        Linear sRGB of light by its bands, shape (3, bands) or (n, bands).

    Returns
    -------
    ndarray
        Light in each band, ≥ 0, shape (bands,); of a colour that no light has, that of the nearest.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.design import smooth_spectrum, spectral_bands
    >>> bands = spectral_bands(np.linspace(400.0, 700.0, 13))
    >>> spectrum = smooth_spectrum(np.array([0.1, 0.6, 0.2]), bands.to_rgb)
    >>> (bands.to_rgb @ spectrum).round(3).tolist(), bool(spectrum.min() >= 0)
    ([0.1, 0.6, 0.2], True)
    """
    n = colours_of_bands.shape[1]
    scale = float(np.abs(rgb).max(initial=0.0))
    if scale == 0:
        return np.zeros(n)
    # Bands where the eye is blind end in darkness, or a spectrum would go on for ever.
    padded = np.eye(n + 2)[:, 1:-1]
    bends = np.diff(padded, 2, axis=0) if n > 1 else np.zeros((0, n))
    unit = np.linalg.norm(colours_of_bands)
    weight = COLOUR_WEIGHT / unit
    system = np.vstack([weight * colours_of_bands * n, bends])
    target = np.concatenate([weight * rgb * n / scale, np.zeros(len(bends))])
    return scale * nonnegative_least_squares(system, target)


@cache
def primary_spectra() -> tuple[FloatArray, ...]:
    """Return the smoothest spectra of red, green and blue of linear sRGB on `PRIMARIES_NM`."""
    eye = observer(CIE_1931)
    step = PRIMARIES_NM[1] - PRIMARIES_NM[0]
    functions = np.stack(
        [np.interp(PRIMARIES_NM, eye.wavelength_nm, each) for each in eye.functions.T]
    )
    colours = np.linalg.solve(XYZ_OF_RGB, functions * step)
    return tuple(smooth_spectrum(primary, colours) for primary in np.eye(3))
