"""Choice of the colour filters that tell most of a strip's bands, by optimal design."""

from collections.abc import Sequence

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.optics import Transmittance

#: Centres in nm of the bands that are to be found, and full width of each at half maximum.
CENTRES_NM: FloatArray = np.linspace(400.0, 700.0, 31)
FWHM_NM = 25.0
#: What is known without filters of a band's centre and width in nm, and of its leakage.
KNOWN = np.array([5.0, 5.0, 0.01])
#: σ of a measured transmittance: a fraction of it, by the filter's table, and noise.
RELATIVE, NOISE = 0.02, 0.003
#: Steps in nm, and of the leakage, of derivatives.
STEPS = np.array([1.0, 1.0, 0.001])
#: Wavelengths in nm over which bands are integrated.
NODES_NM: FloatArray = np.arange(360.0, 761.0, 1.0)


def most_informative_filters(filters: Sequence[Transmittance], count: int) -> tuple[str, ...]:
    """Return the names of the colour filters that tell most of a strip's bands.

    Filters are added one by one, each the one with which the determinant of the information on
    centre, width and leakage of all bands grows most (D-optimal; Fedorov, *Theory of Optimal
    Experiments*, 1972). A filter tells of a band where it changes steeply within it.

    Parameters
    ----------
    filters
        Transmittances of all filters at hand.
    count
        Number of filters to choose; all are returned if there are fewer.

    Returns
    -------
    tuple of str
        Names in the order of `filters`.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit.lvf import most_informative_filters
    >>> from labrig.optics import Transmittance
    >>> nm = np.array([300.0, 540.0, 560.0, 800.0])
    >>> edge = Transmittance("edge", nm, np.array([0.0, 0.0, 0.9, 0.9]))
    >>> grey = Transmittance("grey", nm, np.full(4, 0.5))
    >>> most_informative_filters([grey, edge], 1)
    ('edge',)
    """
    slopes = np.stack([_slopes(transmittance) for transmittance in filters])
    information = np.broadcast_to(np.diag(KNOWN**-2.0), (len(CENTRES_NM), 3, 3)).copy()
    left, chosen = list(range(len(filters))), list[int]()
    while left and len(chosen) < count:
        products = slopes[left][..., :, np.newaxis] * slopes[left][..., np.newaxis, :]
        gains = np.linalg.slogdet(information + products)[1].sum(axis=1)
        best = left.pop(int(np.argmax(gains)))
        information += slopes[best][..., :, np.newaxis] * slopes[best][..., np.newaxis, :]
        chosen.append(best)
    return tuple(filters[number].name for number in sorted(chosen))


def _slopes(transmittance: Transmittance) -> FloatArray:
    """Return the derivatives of what a filter leaves of each band, in σ, shape (bands, 3)."""
    passed = transmittance.at(NODES_NM)
    value = _left(passed, np.zeros(3))
    sigma = np.hypot(RELATIVE * value, NOISE)
    changed = [_left(passed, step) for step in np.diag(STEPS)]
    columns = [(more - value) / (step * sigma) for more, step in zip(changed, STEPS, strict=True)]
    return np.stack(columns, axis=1)


def _left(passed: FloatArray, change: FloatArray) -> FloatArray:
    """Return the fraction that a filter leaves of Gaussian bands with changed parameters."""
    shift_nm, wider_nm, leakage = change
    away = (NODES_NM - (CENTRES_NM[:, np.newaxis] + shift_nm)) / (FWHM_NM + wider_nm)
    bands = np.exp(-4 * np.log(2.0) * away**2) + leakage
    fraction: FloatArray = bands @ passed / bands.sum(axis=1)
    return fraction
