"""A decay: dark frames, a metered charge, then charge, lamp off and photographs of the glow.

After Nalbach et al., Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.4.
"""

from collections.abc import Sequence

from labrig.acquire import Unit

from .decay_settings import DecaySettings
from .decay_units import DaylightUnit, DecayUnit
from .steps.glow_units import METER_CHARGE_S, DarkUnit, MeterUnit


class Decay(DecaySettings):
    """The decay protocol; see `decay.yaml` for what each key means."""

    def units(self) -> Sequence[Unit]:
        """Darks, metering, the decays, daylight; what is not needed is left out."""
        units: list[Unit] = []
        if self.dark == "frames":
            units.append(DarkUnit(self))
        if isinstance(self.exposure, str):
            longest_s = self.charge if isinstance(self.charge, float) else METER_CHARGE_S
            units.append(MeterUnit(self, longest_s))
        units += [DecayUnit(self, f"decay-{number}") for number in range(1, self.repeats + 1)]
        if self.daylight:
            units.append(DaylightUnit(self))
        return units
