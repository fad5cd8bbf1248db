"""What can be wrong with a simulated camera or its cable."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CameraFaults:
    """Misfortunes of one simulated camera, each of which happens as often as said, then no more.

    Attributes
    ----------
    busy_releases
        So many full presses are answered DeviceBusy, whatever the state of the camera.
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
    stall_at: int | None = None
    timeout_once_at: int | None = None
    lost_event: bool = False
    unplug_at_s: float | None = None
    unplug_after_bytes: int | None = None
    replug_after_s: float | None = None
