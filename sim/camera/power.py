"""Automatic switching-off of the camera."""

from collections.abc import Callable

from labrig.foundation.clock import Clock


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
        """Whether the camera is off; only a person can switch it on again."""
        idle_since_s = max(self._spoken_to_s, self._exposing_until_s())
        return 0 < self._after_s < self._clock.now() - idle_since_s

    def put_off(self) -> None:
        """Note a request to the camera, which postpones its switching-off."""
        if not self.is_off:
            self._spoken_to_s = self._clock.now()
