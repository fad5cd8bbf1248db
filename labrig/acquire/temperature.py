"""Log of the rig's thermometer, which delays no action and ends no run."""

import math
from collections.abc import Callable

from labrig.acquire.rig import Rig, device_errors
from labrig.acquire.roles import THERMOMETER
from labrig.foundation.errors import DeviceError

#: Period of readings during waits; rooms change within ten minutes.
READ_PERIOD_S = 60.0

#: Receiver of a reading: degrees Celsius, and time on the rig's clock in seconds.
Keep = Callable[[float, float], None]


class TemperatureLog:
    """Reader of the rig's thermometer, if it has one.

    A failure gives one warning; the thermometer is read again when the next reading is due.

    Parameters
    ----------
    rig
        Open devices of the bench.
    warn
        Function that shows a warning to a person.

    Attributes
    ----------
    is_kept
        Whether the rig has a thermometer.
    """

    def __init__(self, rig: Rig, warn: Callable[[str], None]) -> None:
        self.is_kept = THERMOMETER in rig
        self._rig = rig
        self._warn = warn
        self._has_warned = False
        self._read_s = -math.inf

    def read(self, keep: Keep) -> None:
        """Read the thermometer now and pass the reading to `keep`."""
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
        """Read the thermometer if the last reading is `READ_PERIOD_S` or longer ago."""
        if self._rig.clock.now() - self._read_s >= READ_PERIOD_S:
            self.read(keep)
