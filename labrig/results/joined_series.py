"""Several series of one patch as one."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from labrig.results.series import Series


def joined(parts: Sequence[Series]) -> Series:
    """One below the other; what they have in common is taken from the first."""
    return replace(
        parts[0],
        t_s=np.concatenate([part.t_s for part in parts]),
        exposure_s=np.concatenate([part.exposure_s for part in parts]),
        values=np.concatenate([part.values for part in parts]),
        sigma=np.concatenate([part.sigma for part in parts]),
        iso=np.concatenate([part.iso for part in parts]),
        f_number=np.concatenate([part.f_number for part in parts]),
        frame=tuple(frame for part in parts for frame in part.frame),
        unit=tuple(unit for part in parts for unit in part.unit),
        flag=tuple(flag for part in parts for flag in part.flag),
    )
