"""Rules of a rig file for calibrations that labrig finds by itself."""

from typing import Literal

from pydantic import Field

from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, Fraction


class CalibrationRules(FrozenModel):
    """Limits within which a kept calibration still holds.

    Attributes
    ----------
    find
        Whether calibrations that are kept beside the runs are used at all.
    at_most_age
        Age beyond which a calibration is too old, for example `720 h`.
    brightness
        Change of the card's brightness through the filter beyond which it no longer holds, for
        example `5 %`: the lamp aged or was moved, or the card is another one.
    colour
        Change of the lamp's light at 420 nm relative to that at 680 nm beyond which it no longer
        holds, for example `3 %`.
    shift_nm
        Shift of the filter before the camera in nm along the strip beyond which it no longer holds.
    unevenness
        Change at single wavelengths that neither brightness nor colour explain, beyond which it no
        longer holds, for example `4 %`: another card or another filter.
    only_warn
        Rules that only give a warning where they are broken.
    """

    find: bool = True
    at_most_age: DurationS = Field(720 * 3600.0, gt=0)
    brightness: Fraction = Field(0.05, gt=0, lt=1)
    colour: Fraction = Field(0.03, gt=0, lt=1)
    shift_nm: float = Field(2.0, gt=0, allow_inf_nan=False)
    unevenness: Fraction = Field(0.04, gt=0, lt=1)
    only_warn: tuple[
        Literal["age", "lens", "brightness", "colour", "shift_nm", "unevenness"], ...
    ] = ("age",)
