"""The latest live picture, handed from the thread that owns the camera to those that show it.

A camera's live view warms its sensor, and a warm sensor is a noisy one: a picture is only fetched
when somebody waits for it.
"""

import threading
from dataclasses import dataclass


@dataclass(frozen=True)
class LivePicture:
    """One picture and its number, which counts from 1."""

    number: int
    jpeg: bytes


class LivePictures:
    """At most one picture, and whether somebody wants the next."""

    def __init__(self) -> None:
        self._latest: LivePicture | None = None
        self._wanted = False
        self._changed = threading.Condition()

    @property
    def latest(self) -> LivePicture | None:
        """The last picture that was shown."""
        with self._changed:
            return self._latest

    def wait_until_wanted(self, at_most_s: float) -> bool:
        """Whether somebody wants a picture, now or within so many seconds of real time."""
        with self._changed:
            return self._changed.wait_for(lambda: self._wanted, at_most_s)

    def show(self, jpeg: bytes) -> None:
        """Hand a picture to everybody who waits."""
        with self._changed:
            number = 1 if self._latest is None else self._latest.number + 1
            self._latest = LivePicture(number, jpeg)
            self._wanted = False
            self._changed.notify_all()

    def after(self, number: int, at_most_s: float) -> LivePicture | None:
        """A picture later than that number, waited for; None if none came in time."""
        with self._changed:
            if self._latest is None or self._latest.number <= number:
                self._wanted = True
                self._changed.notify_all()
                self._changed.wait_for(
                    lambda: self._latest is not None and self._latest.number > number, at_most_s
                )
            latest = self._latest
        return latest if latest is not None and latest.number > number else None
