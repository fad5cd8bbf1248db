"""The camera's habit of switching itself off."""

from labrig.clock import Clock


class AutoPowerOff:
    """Off for good when nobody has spoken to the camera for `after_s` seconds; 0 for never."""

    def __init__(self, clock: Clock, after_s: float) -> None:
        self._clock = clock
        self._after_s = after_s
        self._spoken_to_s = clock.now()

    @property
    def is_off(self) -> bool:
        """Whether it has happened; only a person can switch the camera on again."""
        return 0 < self._after_s < self._clock.now() - self._spoken_to_s

    def put_off(self) -> None:
        """Somebody speaks to the camera."""
        if not self.is_off:
            self._spoken_to_s = self._clock.now()
