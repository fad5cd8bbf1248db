"""What can be wrong with a simulated camera or its cable."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraFaults:
    """Misfortunes of one simulated camera, each of which happens as often as said, then no more.

    Attributes
    ----------
    busy_releases
        So many full presses are answered DeviceBusy, whatever the state of the camera.
    busy_spans_s, full_spans_s
        (begin, end) on the clock between which every full press is answered DeviceBusy, or
        StoreFull.
    stall_at
        Operation code whose data phase, or whose answer if it has none, stalls the pipes the
        first time. Data from the host is then not acted on.
    timeout_once_at
        Operation code whose answer is never sent the first time, although the camera obeys.
    lost_event
        The first RequestObjectTransfer event is never queued.
    unplug_at_s
        The cable is pulled at this time of the clock.
    unplug_after_bytes
        The cable is pulled when so many bytes have passed over the bulk pipes.
    replug_after_s
        The cable is put back so much later; never if not given.
    """

    busy_releases: int = 0
    busy_spans_s: tuple[tuple[float, float], ...] = ()
    full_spans_s: tuple[tuple[float, float], ...] = ()
    stall_at: int | None = None
    timeout_once_at: int | None = None
    lost_event: bool = False
    unplug_at_s: float | None = None
    unplug_after_bytes: int | None = None
    replug_after_s: float | None = None

    def is_busy(self, now_s: float) -> bool:
        """Whether the camera has no time for a release now."""
        return _within(self.busy_spans_s, now_s)

    def is_full(self, now_s: float) -> bool:
        """Whether the camera believes now that it has no room."""
        return _within(self.full_spans_s, now_s)


def _within(spans_s: tuple[tuple[float, float], ...], now_s: float) -> bool:
    return any(begin_s <= now_s < end_s for begin_s, end_s in spans_s)
