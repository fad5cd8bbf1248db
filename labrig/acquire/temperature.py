"""The rig's thermometer, read now and then: it holds nothing up and ends no run."""

import math
from collections.abc import Callable

from labrig.acquire.rig import Rig, device_errors
from labrig.acquire.roles import THERMOMETER
from labrig.errors import DeviceError

#: How often while something is waited for; rooms change in ten minutes.
READ_PERIOD_S = 60.0

#: What becomes of a reading: degrees Celsius, and when on the rig's clock.
Keep = Callable[[float, float], None]


class TemperatureLog:
    """Reads the thermometer, if the rig has one.

    One that fails is told of once, and read again when the next reading is due.

    Parameters
    ----------
    warn
        Tells a person.
    """

    def __init__(self, rig: Rig, warn: Callable[[str], None]) -> None:
        self.is_kept = THERMOMETER in rig
        self._rig = rig
        self._warn = warn
        self._has_warned = False
        self._read_s = -math.inf

    def read(self, keep: Keep) -> None:
        """Read now."""
        if not self.is_kept:
            return
        self._read_s = start_s = self._rig.clock.now()
        try:
            with device_errors(THERMOMETER.key):
                celsius = self._rig[THERMOMETER].celsius()
        except DeviceError as error:
            if not self._has_warned:
                self._warn(f"the run goes on without temperatures: {error}")
            self._has_warned = True
            return
        keep(celsius, (start_s + self._rig.clock.now()) / 2)

    def read_if_due(self, keep: Keep) -> None:
        """Read if the last reading is long ago."""
        if self._rig.clock.now() - self._read_s >= READ_PERIOD_S:
            self.read(keep)
