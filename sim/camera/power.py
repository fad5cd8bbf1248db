"""The camera's habit of switching itself off."""

from collections.abc import Callable

from labrig.clock import Clock


class AutoPowerOff:
    """Off for good after `after_s` seconds in which nobody has spoken to the camera; 0 for never.

    Parameters
    ----------
    clock
        Time.
    after_s
        As set in the menu.
    exposing_until_s
        Until when the shutter is open: a camera that exposes stays on.
    """

    def __init__(self, clock: Clock, after_s: float, exposing_until_s: Callable[[], float]) -> None:
        self._clock = clock
        self._after_s = after_s
        self._exposing_until_s = exposing_until_s
        self._spoken_to_s = clock.now()

    @property
    def is_off(self) -> bool:
        """Whether it has happened; only a person can switch the camera on again."""
        idle_since_s = max(self._spoken_to_s, self._exposing_until_s())
        return 0 < self._after_s < self._clock.now() - idle_since_s

    def put_off(self) -> None:
        """Somebody speaks to the camera."""
        if not self.is_off:
            self._spoken_to_s = self._clock.now()
