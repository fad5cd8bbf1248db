"""Looking through a rig's camera in the browser: aim, focus, draw regions into a protocol."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Never

from labrig.acquire import CAMERA, VIEWFINDER, LiveView, Rig, read_rig_file
from labrig.bench import open_bench
from labrig.clock import Clock
from labrig.errors import UsageError
from labrig.setup.view_server import AimedProtocol, LivePictures, ViewServer

#: Ten pictures a second are enough for a hand on a focus ring, and leave the camera some rest.
PICTURE_PERIOD_S = 0.1
#: Ctrl-C is answered at least so often, in real time.
LOOK_UP_S = 0.1
#: Devices that may have a live view, the one made for it first.
_EYES = (VIEWFINDER.key, CAMERA.key)


def view_rig(
    rig_path: Path, protocol_path: Path | None, port: int, tell: Callable[[str], None]
) -> Never:
    """Show a rig's live view until somebody stops it.

    Parameters
    ----------
    rig_path
        The rig file.
    protocol_path
        The protocol file in which regions are written, if any.
    port
        On 127.0.0.1; 0 for any free one.
    tell
        Called once with the page's address.

    Raises
    ------
    Interrupted
        How it ends: the devices are safe, the viewfinder is off.
    UsageError
        A malformed file, a port that is taken, or a rig without live view.
    DeviceError
        A device that fails.
    """
    protocol = None if protocol_path is None else AimedProtocol(protocol_path)
    file = read_rig_file(rig_path)
    pictures = LivePictures()
    with (
        open_bench(file, str(rig_path)) as bench,
        bench.devices() as rig,
        ViewServer(pictures, protocol, rig.name, port) as server,
        server.running(),
    ):
        eye = _eye(rig, rig_path)
        tell(server.url)
        hand_over(pictures, eye, rig.clock)


def hand_over(pictures: LivePictures, eye: LiveView, clock: Clock) -> Never:
    """Fetch a picture whenever somebody waits for one; only this thread touches the camera.

    Real time is paced here whatever the rig's clock: the browser and the person in front of it are
    real also where the room is simulated.

    Raises
    ------
    Interrupted
        Somebody asked to stop.
    DeviceError
        No picture comes.
    """
    pause = threading.Event()
    while True:
        if pictures.wait_until_wanted(LOOK_UP_S):
            pictures.show(eye.preview())
            pause.wait(PICTURE_PERIOD_S)
        clock.sleep(0.0)  # where an interruption is answered


def _eye(rig: Rig, rig_path: Path) -> LiveView:
    for key in _EYES:
        device = rig.devices.get(key)
        if isinstance(device, LiveView):
            return device
    raise UsageError(
        f"{rig_path}: no device with a live view; add a camera that has one, or a webcam as "
        "'viewfinder: {driver: uvc_preview, address: \"uvc://0\"}'"
    )
