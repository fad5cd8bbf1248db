"""Live view of a rig's camera in the browser, to aim, focus and draw regions into a protocol."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import Annotated, Any, ClassVar, Never

from pydantic import Field, StringConstraints

from labrig.acquire import CAMERA, VIEWFINDER, LiveView, Rig, read_protocol, read_rig_file
from labrig.bench import open_bench
from labrig.foundation.clock import Clock
from labrig.foundation.errors import UsageError
from labrig.foundation.models import FrozenModel
from labrig.foundation.region import Region, parse_region
from labrig.foundation.yaml_file import validate
from labrig.local_server import LocalServer, RequestHandler
from labrig.setup.patches_block import KEY, rounded, write_patches
from labrig.setup.picture_stats import decode, picture_stats


@dataclass(frozen=True)
class LivePicture:
    """A live picture with its number, from 1."""

    number: int
    jpeg: bytes


class LivePictures:
    """Exchange of live pictures between camera and browsers, which holds the latest one.

    A camera's live view warms its sensor and so raises its noise: a picture is only fetched when a
    browser waits for it.
    """

    def __init__(self) -> None:
        self._latest: LivePicture | None = None
        self._is_wanted = False
        self._changed = threading.Condition()

    @property
    def latest(self) -> LivePicture | None:
        """The latest picture; None before the first one."""
        with self._changed:
            return self._latest

    def wait_until_wanted(self, at_most_s: float) -> bool:
        """True if a browser waits for a picture, now or within `at_most_s` seconds of real time."""
        with self._changed:
            return self._changed.wait_for(lambda: self._is_wanted, at_most_s)

    def show(self, jpeg: bytes) -> None:
        """Pass a picture to all browsers that wait."""
        with self._changed:
            number = 1 if self._latest is None else self._latest.number + 1
            self._latest = LivePicture(number, jpeg)
            self._is_wanted = False
            self._changed.notify_all()

    def after(self, number: int, at_most_s: float) -> LivePicture | None:
        """Return a picture later than `number`; None if none comes within `at_most_s` seconds."""
        with self._changed:
            if self._latest is None or self._latest.number <= number:
                self._is_wanted = True
                self._changed.notify_all()
                self._changed.wait_for(
                    lambda: self._latest is not None and self._latest.number > number, at_most_s
                )
            latest = self._latest
        return latest if latest is not None and latest.number > number else None


class EditableProtocol:
    """A user's protocol file.

    Parameters
    ----------
    path
        Protocol file.

    Raises
    ------
    UsageError
        If the file is not a protocol, or one of a kind without regions.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise UsageError(
                f"{path}: no such protocol file; regions are written into a file of your own, so "
                "copy a shipped one first (see labrig protocol list)"
            )
        self._regions = self._read()

    def in_fractions(self) -> list[dict[str, Any]]:
        """Return the regions given in fractions of the frame, with their names."""
        return [
            {"name": name, "region": list(region)}
            for name, region in self._regions.items()
            if max(region) <= 1
        ]

    def in_pixels(self) -> list[str]:
        """Return the names of regions in pixels of a RAW frame, whose size is not known here."""
        return [name for name, region in self._regions.items() if max(region) > 1]

    def write(self, patches: Mapping[str, Region]) -> list[dict[str, Any]]:
        """Replace the regions in the file; return them as the file now has them.

        Raises
        ------
        UsageError
            If the protocol would be invalid; the file is unchanged.
        DiskError
            If the file cannot be written.
        """
        write_patches(self.path, {name: rounded(region) for name, region in patches.items()})
        self._regions = self._read()
        return self.in_fractions()

    def _read(self) -> dict[str, Region]:
        model = read_protocol(self.path)
        regions = getattr(model, KEY, None)
        if regions is None:
            raise UsageError(
                f"{self.path}: a protocol of the kind '{model.protocol}' has no '{KEY}:' to draw"
            )
        return dict(regions)


MAX_PATCHES = 200
#: Tolerance of the page's rounding, by which a region may exceed the frame.
ROUNDING = 1e-6
#: Names on one line of YAML, without control characters and line ends.
_ONE_LINE = r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]+$"

Name = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=60, pattern=_ONE_LINE),
]


class DrawnPatch(FrozenModel):
    """A region in fractions of the frame, with its name."""

    name: Name
    region: Region


class DrawnPatches(FrozenModel):
    """All regions drawn on the page."""

    patches: tuple[DrawnPatch, ...] = Field(min_length=1, max_length=MAX_PATCHES)

    def by_name(self) -> dict[str, Region]:
        """Return the regions by name.

        Raises
        ------
        UsageError
            If two regions have one name, or a region exceeds the frame.
        """
        regions: dict[str, Region] = {}
        for patch in self.patches:
            x, y, width, height = patch.region
            if max(x + width, y + height) > 1 + ROUNDING:
                raise UsageError(
                    f"'{patch.name}' leaves the frame; expected fractions of it, "
                    f"got {list(patch.region)}"
                )
            if patch.name in regions:
                raise UsageError(f"two regions are called '{patch.name}'; rename one")
            regions[patch.name] = patch.region
        return regions


#: Longest wait for a picture until the browser has to repeat its request.
PICTURE_TIMEOUT_S = 10.0
_HERE = Path(__file__).parent

PAGES: Mapping[str, Path] = {
    "": _HERE / "view_page.html",
    "view_page.css": _HERE / "view_page.css",
    "view_page.js": _HERE / "view_page.js",
    "view_regions.js": _HERE / "view_regions.js",
}


class ViewServer(LocalServer):
    """Server of the page, the live pictures and the regions of one protocol.

    Parameters
    ----------
    pictures
        Exchange of the live pictures.
    protocol
        Protocol whose regions are drawn; None if there is no file to write.
    rig_name
        Name of the rig, for the page's heading.
    port
        TCP port on 127.0.0.1; 0 for any that is free.

    Raises
    ------
    UsageError
        If the port is taken.
    """

    def __init__(
        self,
        pictures: LivePictures,
        protocol: EditableProtocol | None,
        rig_name: str,
        port: int = 0,
    ) -> None:
        self.pictures = pictures
        self.protocol = protocol
        self.rig_name = rig_name
        super().__init__(port, _Conversation)


class _Conversation(RequestHandler):
    """A connection of a browser."""

    server: ViewServer
    pages: ClassVar[Mapping[str, Path]] = PAGES

    def answer(self, path: str) -> None:
        """Send the latest picture, its statistics, the regions or a page."""
        if path == "frame.jpg":
            self._send_picture()
        elif path == "stats":
            self._send_stats()
        elif path == "patches":
            self.send_json(HTTPStatus.OK, self._patches())
        else:
            super().answer(path)

    def accept(self, path: str, body: bytes) -> None:
        """Write the regions to the protocol."""
        if path != "patches" or self.server.protocol is None:
            self.refuse(HTTPStatus.NOT_FOUND, "there is no protocol file to write to")
            return
        regions = validate(self.json_object(body), DrawnPatches, "regions").by_name()
        self.send_json(HTTPStatus.OK, {"written": self.server.protocol.write(regions)})

    def _send_picture(self) -> None:
        last_number = self.query("after") or "0"
        picture = self.server.pictures.after(
            int(last_number) if last_number.isdecimal() and len(last_number) < 12 else 0,
            PICTURE_TIMEOUT_S,
        )
        if picture is None:
            self.refuse(HTTPStatus.SERVICE_UNAVAILABLE, "no live picture yet")
            return
        self.send(HTTPStatus.OK, "image/jpeg", picture.jpeg, {"X-Picture": str(picture.number)})

    def _send_stats(self) -> None:
        latest = self.server.pictures.latest
        if latest is None:
            self.refuse(HTTPStatus.SERVICE_UNAVAILABLE, "no live picture yet")
            return
        text = self.query("region")
        region = None if text is None else parse_region(text)
        stats = picture_stats(decode(latest.jpeg), region)
        self.send_json(HTTPStatus.OK, {"number": latest.number, **stats.to_json()})

    def _patches(self) -> dict[str, Any]:
        protocol = self.server.protocol
        return {
            "rig": self.server.rig_name,
            "protocol": None if protocol is None else protocol.path.name,
            "patches": [] if protocol is None else protocol.in_fractions(),
            "in_pixels": [] if protocol is None else protocol.in_pixels(),
        }


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
