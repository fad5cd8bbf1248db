"""Faults of a simulated camera or its cable."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraFaults:
    """Faults of one simulated camera, each of which happens that number of times and then no more.

    Attributes
    ----------
    busy_releases
        Number of full presses that are answered DeviceBusy, whatever the state of the camera.
    busy_spans_s, full_spans_s
        Spans (begin, end) on the clock in which every full press is answered DeviceBusy, or
        StoreFull.
    stall_at
        Operation code whose data phase, or whose answer if it has none, stalls the pipes the first
        time. The camera does not act on data from the host then.
    timeout_once_at
        Operation code whose answer is never sent the first time, although the camera obeys.
    lost_event
        Whether the first RequestObjectTransfer event is never queued.
    unplug_at_s
        Time of the clock at which the cable is pulled.
    unplug_after_bytes
        Number of bytes over the bulk pipes after which the cable is pulled.
    replug_after_s
        Time in seconds after which the cable is plugged in again; None: never.
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
        """Return whether the camera is busy for a release now."""
        return _within(self.busy_spans_s, now_s)

    def is_full(self, now_s: float) -> bool:
        """Return whether the camera reports no room now."""
        return _within(self.full_spans_s, now_s)


def _within(spans_s: tuple[tuple[float, float], ...], now_s: float) -> bool:
    return any(begin_s <= now_s < end_s for begin_s, end_s in spans_s)
