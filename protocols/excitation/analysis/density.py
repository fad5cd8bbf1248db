"""Largest optical density that a sample may have in each band, by what is known of it."""

from itertools import pairwise

import numpy as np

from labrig.calibration import PatchReflectance
from labrig.foundation.arrays import FloatArray
from labrig.results import PRIOR_DENSITY, DensityBasis

#: σ of an albedo by which less light may have come back.
SIGMAS = 2.0


def largest_density(
    bands_nm: tuple[float, ...], stated: float | None, reflectance: PatchReflectance | None
) -> tuple[FloatArray, DensityBasis]:
    """Return the largest optical density in each band, shape (B,), and where it is from.

    A layer that absorbs the fraction 1 − 10^(−D) of the light sends back at most 10^(−D) of it. An
    albedo R so bounds D to −lg R in every band where it was measured, if the layer does not
    scatter: light that scatters deep in an opaque one may come back, and depth be dark all the
    same.

    Parameters
    ----------
    bands_nm
        Edges of the bands in nm.
    stated
        Largest optical density in any band, as the protocol states it; it goes before a
        reflectance, from which that of a scattering sample does not follow.
    reflectance
        Reflectance of the sample.
    """
    bands = len(bands_nm) - 1
    if stated is not None:
        return np.full(bands, stated), DensityBasis.STATED
    of_bands = np.full(bands, PRIOR_DENSITY)
    if reflectance is None:
        return of_bands, DensityBasis.PRIOR
    nm, albedo = np.array(reflectance.wavelength_nm), np.array(reflectance.albedo)
    least = albedo - SIGMAS * np.array(reflectance.albedo_sigma)
    for band, (low, high) in enumerate(pairwise(bands_nm)):
        inside = least[(nm >= low) & (nm <= high)]
        if not len(inside) and nm[0] <= (low + high) / 2 <= nm[-1]:
            inside = np.array([np.interp((low + high) / 2, nm, least)])
        if len(inside):
            back = float(np.clip(inside.min(), 10.0**-PRIOR_DENSITY, 1.0))
            of_bands[band] = -np.log10(back)
    is_bound = of_bands.max() < PRIOR_DENSITY
    return of_bands, DensityBasis.REFLECTANCE if is_bound else DensityBasis.PRIOR
