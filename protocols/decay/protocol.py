"""A decay: dark frames, a metered charge, then charge, lamp off and photographs of the glow.

After Nalbach et al., Practical Capture and Reproduction of Phosphorescent Appearance, sec. 4.4.
"""

from collections.abc import Sequence

from labrig.acquire import Unit
from labrig.protocols.steps.bench_configuration import BenchConfiguration, ConfiguredUnit
from labrig.protocols.steps.decays import WHY, DaylightUnit, DecaySettings
from labrig.protocols.steps.glow import METER_CHARGE_S, DarkUnit, MeterUnit


class Decay(DecaySettings):
    """Decay protocol; `decay.yaml` is the commented example."""

    def configured_units(self) -> Sequence[ConfiguredUnit]:
        """Return darks, metering, decays and daylight, as far as needed."""
        units: list[Unit] = []
        if isinstance(self.exposure, str):
            longest_s = self.charge if isinstance(self.charge, float) else METER_CHARGE_S
            units.append(MeterUnit(self, longest_s))
        units += self.decays()
        if self.daylight:
            units.append(DaylightUnit(self))
        scenes = [ConfiguredUnit(unit, BenchConfiguration(), WHY) for unit in units]
        if self.dark != "frames":
            return scenes
        return [ConfiguredUnit(DarkUnit(self), BenchConfiguration(), WHY, is_dark=True), *scenes]
