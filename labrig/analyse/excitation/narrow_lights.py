"""Whether selected lights stand for their bands.

The fit takes the excitation for the same all over a band. A narrow light, and the part of it that
lies in the next band, sees it at its own wavelengths: how much that may matter tells a smooth
course with the same means over the bands.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from labrig.calibration import IrradianceFile
from labrig.results import FittedExcitation, FloatArray

#: Deviation of a band's rate by the course within it that causes a warning,
NOTABLE = 0.2
#: in bands whose rate is at least so large, as a fraction of the largest.
LARGE = 0.02
#: Wavelengths at which the course is read, in standard deviations of the light, and weights.
NODES: FloatArray = np.linspace(-3.0, 3.0, 61)
WEIGHTS: FloatArray = np.exp(-(NODES**2) / 2)


def narrow_light_warnings(fit: FittedExcitation, irradiance: IrradianceFile) -> Iterator[str]:
    """Yield a line if rates may be off since the lights see parts of their bands only.

    Parameters
    ----------
    fit
        Fitted excitation.
    irradiance
        Irradiance on the sample; that behind the variable filter fills every band.
    """
    if not irradiance.lights:
        return
    edges = np.array(irradiance.bands_nm)
    off = np.max([np.abs(_deviation(rates, edges, irradiance)) for rates in fit.k_e()], axis=0)
    bands = [
        f"{low:g}-{high:g} nm by about {100 * deviation:.0f} %"
        for (low, high), deviation in zip(pairwise(edges), off, strict=True)
        if deviation > NOTABLE
    ]
    if bands:
        yield (
            "excitation changes so much from band to band that rates may be off "
            f"({', '.join(bands)}) if it does within bands, too: select more lights, and "
            "give irradiance bands_nm as narrow as their distance"
        )


def _deviation(rates: FloatArray, edges_nm: FloatArray, irradiance: IrradianceFile) -> FloatArray:
    """Return the deviation that a smooth course makes of every band's rate; 0 of small rates."""
    running = np.concatenate([[0.0], np.cumsum(rates * np.diff(edges_nm))])
    course = PchipInterpolator(edges_nm, running).derivative()
    through = np.array(irradiance.through)
    deviation = np.zeros(len(rates))
    for band in np.flatnonzero(rates > LARGE * rates.max()):
        light = int(np.argmax(through[:, band]))
        at_nm = irradiance.centre_nm[light] + irradiance.width_nm[light] * NODES
        is_inside = (at_nm >= edges_nm[0]) & (at_nm < edges_nm[-1])
        nm, weight = at_nm[is_inside], WEIGHTS[is_inside]
        band_of = np.searchsorted(edges_nm, nm, side="right") - 1
        own = weight[band_of == band].sum()
        if own > 0:
            deviation[band] = weight @ (course(nm) - rates[band_of]) / (own * rates[band])
    return deviation
