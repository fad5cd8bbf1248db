"""The release: states of the button's two stages and of the shutter behind it.

    idle ──full press──> waiting (lag, self-timer) ──> open ──> reading out ──> idle
      └─half press─> focusing ──> focused ──full press──> waiting (lag only)

Nothing runs in the background: a state is computed from the clock.
"""

import math
import random
from dataclasses import dataclass
from enum import IntFlag

from labrig.foundation.clock import Clock

#: Time of autofocus on a visible object.
FOCUS_S = 0.1
#: Time of light metering, for which even a lens on manual focus waits.
METERING_S = 0.02
#: Time until the mirror is down, the sensor read out and the file written.
READOUT_S = 0.2
#: Time until the second curtain closes after the command to end a bulb exposure.
BULB_CLOSE_S = 0.01


class Stage(IntFlag):
    """Stages of the release button, as RemoteReleaseOn and -Off count them."""

    HALF = 1
    FULL = 2


@dataclass(frozen=True)
class Exposure:
    """One opening of the shutter; a bulb exposure ends at infinity until it is ended."""

    start_s: float
    end_s: float

    @property
    def is_endless(self) -> bool:
        """Whether this is a bulb exposure that has not been ended."""
        return self.end_s == math.inf


class Shutter:
    """Button and shutter of one camera.

    Parameters
    ----------
    clock
        The room's clock.
    lag_s, jitter_s
        Mean and standard deviation of the time from a full press to the open shutter.
    seed
        Seed of the jitter.
    """

    def __init__(self, clock: Clock, lag_s: float, jitter_s: float, seed: int) -> None:
        self._clock = clock
        self._lag_s = lag_s
        self._jitter_s = jitter_s
        self._random = random.Random(seed)
        self._settled_s: float | None = None
        self._is_held = False
        self._exposure = Exposure(-math.inf, -math.inf)

    @property
    def is_open(self) -> bool:
        """Whether light falls on the sensor now."""
        return self._exposure.start_s <= self._clock.now() < self._exposure.end_s

    @property
    def is_endless(self) -> bool:
        """Whether a bulb exposure waits for its end."""
        return self._exposure.is_endless

    @property
    def open_until_s(self) -> float:
        """End of the last exposure; infinity at bulb, −infinity before the first."""
        return self._exposure.end_s

    @property
    def is_ready(self) -> bool:
        """Whether a full press would be obeyed: idle, not focusing, button up."""
        now_s = self._clock.now()
        exposing = now_s < self._exposure.end_s + READOUT_S
        focusing = self._settled_s is not None and now_s < self._settled_s
        return not (exposing or focusing or self._is_held)

    def press_half(self, settling_s: float) -> None:
        """Focus and meter, which takes time; again only after the button was released."""
        if self._settled_s is None:
            self._settled_s = self._clock.now() + settling_s

    def press_full(self, settling_s: float, timer_s: float, exposure_s: float) -> Exposure:
        """Expose; without a half press before, focusing comes on top of the lag."""
        lag_s = max(0.0, self._random.gauss(self._lag_s, self._jitter_s)) + timer_s
        if self._settled_s is None:
            lag_s += settling_s
        start_s = self._clock.now() + lag_s
        self._is_held = True
        self._exposure = Exposure(start_s, start_s + exposure_s)
        return self._exposure

    def let_go(self, stages: Stage) -> None:
        """Release stages of the button."""
        if Stage.FULL in stages:
            self._is_held = False
        if Stage.HALF in stages:
            self._settled_s = None

    def end_bulb(self) -> Exposure | None:
        """Close the shutter of a bulb exposure; return the exposure, or None if there is none."""
        if not self.is_endless:
            return None
        start_s = self._exposure.start_s
        self._exposure = Exposure(start_s, max(self._clock.now(), start_s) + BULB_CLOSE_S)
        return self._exposure
