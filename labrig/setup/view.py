"""Live view of a rig's camera in the browser, to aim, focus and draw regions into a protocol."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Never

from labrig.acquire import CAMERA, VIEWFINDER, LiveView, Rig, read_rig_file
from labrig.bench import open_bench
from labrig.foundation.clock import Clock
from labrig.foundation.errors import UsageError
from labrig.setup.view_server import EditableProtocol, LivePictures, ViewServer

#: Period of the pictures: enough for focusing by hand, with pauses for the camera.
PICTURE_PERIOD_S = 0.1
#: Longest real time until Ctrl-C is answered.
CHECK_INTERVAL_S = 0.1
#: Keys of devices that may have a live view, in order of preference.
_LIVE_VIEW_KEYS = (VIEWFINDER.key, CAMERA.key)


def view_rig(
    rig_path: Path, protocol_path: Path | None, port: int, tell: Callable[[str], None]
) -> Never:
    """Show the live view of a rig in the browser until it is interrupted.

    Parameters
    ----------
    rig_path
        Rig file.
    protocol_path
        Protocol file to which regions are written; None for a page without regions.
    port
        TCP port on 127.0.0.1; 0 for any that is free.
    tell
        Function that is called once, with the address of the page.

    Raises
    ------
    Interrupted
        On Ctrl-C; the devices are then safe and the viewfinder is off.
    UsageError
        If a file is malformed, the port is taken, or the rig has no live view.
    DeviceError
        If a device fails.

    Examples
    --------
    >>> import signal
    >>> from pathlib import Path
    >>> from labrig.foundation.clock import Interrupted
    >>> from labrig.setup import view_rig
    >>> def tell(url):
    ...     print(url.partition(":")[0])
    ...     raise Interrupted(signal.SIGINT)  # Ctrl-C, as soon as the page is served
    >>> try:
    ...     view_rig(Path("runs/decay/rig.yaml"), None, 0, tell)
    ... except Interrupted:
    ...     print("devices are safe")
    http
    devices are safe
    """
    protocol = None if protocol_path is None else EditableProtocol(protocol_path)
    file = read_rig_file(rig_path)
    pictures = LivePictures()
    with (
        open_bench(file, str(rig_path)) as bench,
        bench.devices() as rig,
        ViewServer(pictures, protocol, rig.name, port) as server,
        server.running(),
    ):
        viewfinder = _viewfinder(rig, rig_path)
        tell(server.url)
        serve_pictures(pictures, viewfinder, rig.clock)


def serve_pictures(pictures: LivePictures, live_view: LiveView, clock: Clock) -> Never:
    """Fetch a picture whenever a browser waits for one; only this thread uses the camera.

    Pictures are paced in real time whatever the rig's clock: browser and user are real even if the
    room is simulated.

    Raises
    ------
    Interrupted
        On Ctrl-C.
    DeviceError
        If no picture arrives.
    """
    pause = threading.Event()
    while True:
        if pictures.wait_until_wanted(CHECK_INTERVAL_S):
            pictures.show(live_view.preview())
            pause.wait(PICTURE_PERIOD_S)
        clock.sleep(0.0)  # where an interruption is answered


def _viewfinder(rig: Rig, rig_path: Path) -> LiveView:
    for key in _LIVE_VIEW_KEYS:
        device = rig.devices.get(key)
        if isinstance(device, LiveView):
            return device
    raise UsageError(
        f"{rig_path}: no device with a live view; add a camera that has one, or a webcam as "
        "'viewfinder: {driver: uvc_preview, address: \"uvc://0\"}'"
    )
