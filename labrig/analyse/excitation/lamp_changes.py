"""How the lamp comes on and goes dark in the bands of an irradiance: as measured, or as usual."""

import numpy as np
from numpy.typing import NDArray

from labrig.calibration.fade_file import Change, FadeFile
from labrig.fit.excitation import Transient

FloatArray = NDArray[np.float64]

#: A halogen lamp falls to 1/e in so long at these wavelengths (physics.md: measured by others),
#: and is dark after `DARK_S` (Nalbach et al., section 4.4).
USUAL_NM = (419.0, 650.0)
USUAL_1_E_S = (0.031, 0.051)
DARK_S = 0.32
STEPS = 64


def lamp_changes(fade: FadeFile | None, bands_nm: FloatArray) -> tuple[Transient, Transient]:
    """Rise and fade; without a file, what halogen lamps usually do.

    A rise that was not measured is taken for the fade upside down: a filament heats about as fast
    as it cools.
    """
    if fade is None:
        dark = _usual(bands_nm)
        return _upside_down(dark), dark
    found = _transient(fade, fade.fade, bands_nm, end=0.0)
    if fade.rise is None:
        return _upside_down(found), found
    return _transient(fade, fade.rise, bands_nm, end=1.0), found


def _transient(file: FadeFile, change: Change, bands_nm: FloatArray, end: float) -> Transient:
    """In steps short enough, until the lamp has arrived."""
    times_s, share = file.in_bands(change, bands_nm)
    fine_s = np.linspace(0.0, times_s[-1], STEPS + 1)
    fine = np.column_stack([np.interp(fine_s, times_s, column) for column in share.T])
    fine[-1] = end
    return Transient.sampled(fine_s, fine)


def _usual(bands_nm: FloatArray) -> Transient:
    middles_nm = (bands_nm[1:] + bands_nm[:-1]) / 2
    tau_s = np.interp(middles_nm, USUAL_NM, USUAL_1_E_S)
    times_s = np.linspace(0.0, DARK_S, STEPS + 1)
    share = np.exp(-times_s[:, None] / tau_s)
    share[-1] = 0.0
    return Transient.sampled(times_s, share)


def _upside_down(fade: Transient) -> Transient:
    return Transient(fade.duration_s, 1 - fade.share)
