"""A photometer's reading under the bare lamp, which gives luminances of a bench their scale."""

import re
from functools import cached_property
from typing import Literal, Self

from pydantic import Field, model_validator

from labrig.foundation.models import FrozenModel
from labrig.foundation.named_files import ShippedOrFile
from labrig.foundation.quantity import Fraction

#: Units of readings, each with the place at which it is taken.
UNITS = {"lx": "sample plane", "cd/m2": "card"}
_READING = re.compile(
    r"\s*(?P<number>\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*(?P<unit>lx|cd\s*/\s*m(?:2|²))\s*"
)

#: Kinds of lamps by which standards excite, and others that a bench may have.
LampType = Literal["xenon", "D65 fluorescent", "fluorescent", "halogen", "LED", "daylight", "other"]


class LuminanceReading(FrozenModel):
    """One reading of a luxmeter or a luminance meter under the bare, warm lamp of the bench.

    Attributes
    ----------
    value
        Reading with its unit: an illuminance such as `312 lx`, or the luminance of the lit grey
        card such as `95 cd/m2`.
    sigma
        Relative standard uncertainty of the reading by the meter's calibration, for example `3 %`.
    at
        Place of the meter: `sample plane` for an illuminance, `card` for a luminance.
    lamp
        Kind of the lamp: `xenon`, `D65 fluorescent`, `fluorescent`, `halogen`, `LED`, `daylight` or
        `other`. Default: not stated, which accords with no standard.
    spectrum
        Spectrum of the lamp at the sample: name of a shipped file or path of a file. Default: that
        of `lamp` under `optics:`.
    f1_prime
        General mismatch index f1′ of the meter, for example `5 %`. Default: not stated.
    """

    value: str
    sigma: Fraction = Field(gt=0, lt=1)
    at: Literal["sample plane", "card"]
    lamp: LampType | None = None
    spectrum: ShippedOrFile | None = None
    f1_prime: Fraction | None = Field(None, ge=0, lt=1)

    @model_validator(mode="after")
    def _unit_of_its_place(self) -> Self:
        match = _READING.fullmatch(self.value)
        if match is None or not float(match["number"]) > 0:
            raise ValueError(
                "value: expected a reading above 0 with its unit, such as '312 lx' or '95 cd/m2', "
                f"got '{self.value}'"
            )
        unit = "lx" if match["unit"] == "lx" else "cd/m2"
        if UNITS[unit] != self.at:
            raise ValueError(
                f"expected lx at the sample plane or cd/m2 at the card, got {unit} at: {self.at}"
            )
        return self

    @cached_property
    def number(self) -> float:
        """Reading in lx at the sample plane, in cd/m² at the card."""
        match = _READING.fullmatch(self.value)
        assert match is not None
        return float(match["number"])
