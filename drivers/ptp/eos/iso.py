"""Native sensitivities of an EOS, which are gains of its sensor, and multiplied ones.

An EOS amplifies in whole stops before it digitises. Thirds of a stop are made from the nearest of
these by multiplication (×1.297, ×0.771 on a 30D), and so are the highest ones (×2 a stop, among
them those called H): nothing is gained, and levels are missing or shared. Only models with
published measurements are listed; for others, ISO 100 to 1600 is assumed. Canon publishes nothing
about it.

Sources:
- 30D: histograms of RAW files of every ISO (ruevski.com/rawhistogram, 2007): whole
  stops to 1600 unscaled, thirds and 3200 scaled.
- DIGIC 4 (5D Mark II to 1100D): Magic Lantern's `is_native_iso`, shoot.c: 100 to 3200 in whole
  stops, "6400 … are digital gains applied to 3200" (later: or amplified very late in the chain,
  "without improving noise").
- 5D Mark III, 6D: electrons at saturation halve a stop from ISO 100 to 6400 (Magic Lantern forum,
  topic 10111); higher ones are reached by the same registers to 12800, which is unconfirmed.
"""

from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

WHOLE_STOPS = (100, 200, 400, 800, 1600, 3200, 6400)
ASSUMED_HIGHEST = 1600

#: Model as DeviceInfo says it → highest native sensitivity.
_HIGHEST = MappingProxyType(
    {
        "Canon EOS 30D": 1600,
        "Canon EOS 5D Mark II": 3200,
        "Canon EOS 7D": 3200,
        "Canon EOS 50D": 3200,
        "Canon EOS 60D": 3200,
        "Canon EOS 500D": 3200,
        "Canon EOS 550D": 3200,
        "Canon EOS 600D": 3200,
        "Canon EOS 1100D": 3200,
        "Canon EOS 5D Mark III": 6400,
        "Canon EOS 6D": 6400,
    }
)


@dataclass(frozen=True)
class NativeIsos:
    """Sensitivities that labrig uses, ascending, and the source of their being native."""

    values: tuple[int, ...]
    source: Literal["rig file", "model", "assumed"]


def isos_of_model(model: str) -> NativeIsos:
    """Return whole stops from ISO 100 to the model's highest native one, or to an assumed one."""
    is_listed = model in _HIGHEST
    highest = _HIGHEST.get(model, ASSUMED_HIGHEST)
    values = tuple(iso for iso in WHOLE_STOPS if iso <= highest)
    return NativeIsos(values, "model" if is_listed else "assumed")
