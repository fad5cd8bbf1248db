"""The USB cable: the time of a transfer, being pulled out, and the camera switching itself off."""

import math
from collections.abc import Callable

from labrig.foundation.clock import Clock, VirtualClock

from ... import usb_errors
from ..faults import CameraFaults


class AutoPowerOff:
    """Switch that is off for good after `after_s` seconds without a request; 0 for never.

    Parameters
    ----------
    clock
        The room's clock.
    after_s
        Time in seconds that is set in the menu.
    exposing_until_s
        Function that returns the end of the exposure: a camera that exposes stays on.
    """

    def __init__(self, clock: Clock, after_s: float, exposing_until_s: Callable[[], float]) -> None:
        self._clock = clock
        self._after_s = after_s
        self._exposing_until_s = exposing_until_s
        self._spoken_to_s = clock.now()

    @property
    def is_off(self) -> bool:
        """True if the camera is off; only a person can switch it on again."""
        idle_since_s = max(self._spoken_to_s, self._exposing_until_s())
        return 0 < self._after_s < self._clock.now() - idle_since_s

    def put_off(self) -> None:
        """Note a request to the camera, which postpones its switching-off."""
        if not self.is_off:
            self._spoken_to_s = self._clock.now()


#: Time of host controller and scheduler for every transfer (one high-speed microframe).
TRANSACTION_S = 125e-6
#: Actual rate of a high-speed bulk pipe.
BYTES_PER_S = 35e6


class Cable:
    """Cable whose transfers take time, and which may be unplugged once.

    Parameters
    ----------
    clock
        The simulated room's clock.
    faults
        Faults, with the times at which the cable is pulled and plugged in again.
    power
        Power of the camera: one that is off is not on the bus either.
    """

    def __init__(self, clock: VirtualClock, faults: CameraFaults, power: AutoPowerOff) -> None:
        self._clock = clock
        self._power = power
        self._unplug_at_s = math.inf if faults.unplug_at_s is None else faults.unplug_at_s
        self._bytes_to_unplug = faults.unplug_after_bytes
        self._away_s = math.inf if faults.replug_after_s is None else faults.replug_after_s

    @property
    def is_plugged(self) -> bool:
        """Whether the cable is in now, with a camera that is on at its end."""
        now_s = self._clock.now()
        return (
            not self._power.is_off
            and not self._unplug_at_s <= now_s < self._unplug_at_s + self._away_s
        )

    @property
    def plugging(self) -> int:
        """Number of times that the cable was plugged in: a camera that returns is a new device."""
        return 2 if self._clock.now() >= self._unplug_at_s else 1

    def carry(self, n_bytes: int) -> None:
        """Take the time of one transfer of that number of bytes.

        Raises
        ------
        usb.core.USBError
            The cable was pulled before the end of it.
        """
        self._power.put_off()
        if self._bytes_to_unplug is not None:
            if n_bytes > self._bytes_to_unplug:
                self._pass(TRANSACTION_S + self._bytes_to_unplug / BYTES_PER_S)
                self._bytes_to_unplug = None
                self._unplug_at_s = self._clock.now()
                raise usb_errors.unplugged()
            self._bytes_to_unplug -= n_bytes
        self._pass(TRANSACTION_S + n_bytes / BYTES_PER_S)

    def wait(self, duration_s: float) -> None:
        """Wait with nothing on the wire."""
        self._pass(duration_s)

    def _pass(self, duration_s: float) -> None:
        to_unplug_s = self._unplug_at_s - self._clock.now()
        if 0 < to_unplug_s <= duration_s:
            self._clock.spend(to_unplug_s)
            raise usb_errors.unplugged()
        self._clock.spend(duration_s)
