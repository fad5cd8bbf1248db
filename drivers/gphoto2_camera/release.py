"""The release button, as far as libgphoto2 lets it be pressed."""

from typing import Protocol

from labrig.foundation.clock import Clock
from labrig.foundation.errors import UsageError

from .failures import BusyError, PerhapsReleasedError
from .library import POLL_PERIOD_S, RELEASE_S, Library, Span

#: Setting of the release button, on Canon EOS only.
BUTTON = "eosremoterelease"
#: Half and full press that leave the lens alone; older versions of libgphoto2 have the others.
_PRESSES = (("Press Half MF", "Press Full MF"), ("Press Half", "Press Full"))
_LET_GO_HALF, _LET_GO_FULL = "Release Half", "Release Full"


class Release(Protocol):
    """A way to release a camera."""

    @property
    def description(self) -> str:
        """Description of the way of release, for people."""

    def get_ready(self) -> None:
        """Do what can be done before the release."""

    def press(self, exposure_s: float) -> Span:
        """Begin an exposure of `exposure_s` seconds; return when, at the earliest and latest.

        Raises
        ------
        BusyError
            No exposure has begun.
        PerhapsReleasedError
            Whether an exposure has begun is unknown.
        """

    def release_full(self, busy_s: float) -> None:
        """Release the second stage; a camera that still exposes may be busy for `busy_s`."""

    def release(self, busy_s: float) -> None:
        """Release both stages, half and full."""


class ButtonRelease:
    """Release by half and full press apart: the second is one short transaction."""

    description = "its remote button"

    def __init__(self, library: Library, clock: Clock, half: str, full: str) -> None:
        self._library = library
        self._clock = clock
        self._half, self._full = half, full
        self._pending_releases: list[str] = []

    def get_ready(self) -> None:
        if _LET_GO_HALF not in self._pending_releases:
            self._pending_releases.append(_LET_GO_HALF)
        self._library.set(BUTTON, self._half, RELEASE_S)

    def press(self, exposure_s: float) -> Span:
        self._pending_releases.append(_LET_GO_FULL)
        try:
            # some cameras answer when the shutter has closed
            return self._library.set(BUTTON, self._full, RELEASE_S + exposure_s)
        except BusyError:
            self._pending_releases.pop()
            raise

    def release_full(self, busy_s: float) -> None:
        if _LET_GO_FULL in self._pending_releases:
            self._release_last(busy_s)

    def release(self, busy_s: float) -> None:
        while self._pending_releases:
            self._release_last(busy_s)

    def _release_last(self, busy_s: float) -> None:
        deadline_s = self._clock.now() + busy_s
        while True:
            try:
                self._library.set(BUTTON, self._pending_releases[-1])
            except BusyError:
                if self._clock.now() >= deadline_s:
                    raise
                self._clock.sleep(POLL_PERIOD_S)
            else:
                self._pending_releases.pop()
                return


class TriggerRelease:
    """Release by libgphoto2 itself; the time of the release within its call depends on the make.

    Sources: `camera_trigger_capture` of libgphoto2 2.5.34; for Canon also measured, against the
    simulated camera, by `tests/acceptance/gphoto2_latency.py`.
    """

    description = "trigger_capture"

    def __init__(self, library: Library, maker: str) -> None:
        self._library = library
        self._maker = maker.lower()

    def get_ready(self) -> None:
        pass

    def press(self, exposure_s: float) -> Span:
        try:
            called = self._library.trigger(exposure_s)
        except BusyError as busy:
            # it may be the letting go that was refused, after the release
            raise PerhapsReleasedError(str(busy)) from None
        if "canon" in self._maker:  # waits for the lens, presses, returns
            return Span(called.end_s, called.end_s)
        if "nikon" in self._maker:  # presses, waits for the end of the exposure
            return Span(called.begin_s, max(called.begin_s, called.end_s - exposure_s))
        return called

    def release_full(self, busy_s: float) -> None:
        pass

    def release(self, busy_s: float) -> None:
        pass


def release_of(library: Library, clock: Clock, maker: str, requested: str | None) -> Release:
    """Return the way of release that the settings name, by default the better one of the camera.

    Raises
    ------
    UsageError
        The camera has no such button.
    """
    offered = library.get(BUTTON).choices if library.has(BUTTON) else ()
    presses = next((pair for pair in _PRESSES if set(pair) <= set(offered)), None)
    if presses is None and requested == "button":
        raise UsageError(
            "the rig file asks for 'release: button', which libgphoto2 has for Canon EOS alone: "
            "leave it out, or write 'release: trigger'"
        )
    if presses is None or requested == "trigger":
        return TriggerRelease(library, maker)
    return ButtonRelease(library, clock, *presses)
