"""The first photograph after every charge, of charges that were photographed at once."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from labrig.fit.excitation import ChargingSeries

#: Charges that are first looked at so many times later than most (those of a metering, by the next
#: look at what is left) do not go with the others.
LATER = 3.0


def first_photographs(series: ChargingSeries, usable: NDArray[np.bool_]) -> dict[int, int]:
    """Row of its first usable photograph, for each charge that was photographed as soon as most.

    Parameters
    ----------
    usable
        (n,) photographs that may be taken.
    """
    ends = np.cumsum([0, *(len(charge.start_s) for charge in series.charges)])
    first = {
        number: low + int(np.argmax(usable[low:high]))
        for number, (low, high) in enumerate(pairwise(ends))
        if usable[low:high].any()
    }
    begins_s = np.concatenate([charge.start_s - charge.off_s for charge in series.charges])
    if not first:
        return {}
    usual_s = float(np.median([begins_s[row] for row in first.values()]))
    return {number: row for number, row in first.items() if begins_s[row] <= LATER * usual_s}
