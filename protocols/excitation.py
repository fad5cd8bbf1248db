"""Excitation rates of all bands at once: charges through the variable filter, then without it.

After Nalbach et al., sec. 4.5 and 4.6, where bands are charged one by one with narrow filters.
"""

from collections.abc import Sequence

from labrig.acquire import Unit

from .excitation_metering import BareMeter, DarkUnit, StripMeter
from .excitation_settings import ExcitationSettings
from .excitation_units import BareUnit, DoublingUnit, RefiningUnit
from .steps.album import Album


class Excitation(ExcitationSettings):
    """The excitation protocol; see `excitation.yaml` for what each key means."""

    def units(self) -> Sequence[Unit]:
        """Darks; a metered charge and all others through the filter; the same without it."""
        album = Album(self.strip())
        return [
            DarkUnit(self, album),
            StripMeter(self, album),
            *(DoublingUnit(self, album, number) for number in range(1, self.at_most + 1)),
            *(RefiningUnit(self, album, number) for number in range(1, self.refine + 1)),
            BareMeter(self, album),
            *(BareUnit(self, album, number) for number in range(1, len(self.bare) + 1)),
        ]
