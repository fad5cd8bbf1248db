"""The page of `labrig rig view`: live pictures, and regions drawn into a protocol."""

from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar

from labrig.local_server import LocalConversation, LocalServer
from labrig.region import parse_region
from labrig.setup.aimed_protocol import AimedProtocol
from labrig.setup.drawn_patches import DrawnPatches
from labrig.setup.live_pictures import LivePictures
from labrig.setup.picture_stats import decode, picture_stats
from labrig.yaml_file import validate

#: How long a browser waits for a picture before it is told to ask again.
PICTURE_TIMEOUT_S = 10.0
_HERE = Path(__file__).parent

PAGES: Mapping[str, Path] = {
    "": _HERE / "view_page.html",
    "view_page.css": _HERE / "view_page.css",
    "view_page.js": _HERE / "view_page.js",
    "view_regions.js": _HERE / "view_regions.js",
}


class ViewServer(LocalServer):
    """Serves the page, live pictures, and the regions of one protocol.

    Parameters
    ----------
    pictures
        Where live pictures come from.
    protocol
        Whose regions are drawn; `None` if there is no file to write.
    rig_name
        For the page's heading.
    port
        0 for any free one.

    Raises
    ------
    UsageError
        The port is taken.
    """

    def __init__(
        self,
        pictures: LivePictures,
        protocol: AimedProtocol | None,
        rig_name: str,
        port: int = 0,
    ) -> None:
        self.pictures = pictures
        self.protocol = protocol
        self.rig_name = rig_name
        super().__init__(port, _Conversation)


class _Conversation(LocalConversation):
    """One connection of a browser."""

    server: ViewServer
    pages: ClassVar[Mapping[str, Path]] = PAGES

    def answer(self, path: str) -> None:
        """Picture, statistics or regions."""
        if path == "frame.jpg":
            self._send_picture()
        elif path == "stats":
            self._send_stats()
        elif path == "patches":
            self.send_json(HTTPStatus.OK, self._patches())
        else:
            super().answer(path)

    def accept(self, path: str, body: bytes) -> None:
        """Write the regions."""
        if path != "patches" or self.server.protocol is None:
            self.refuse(HTTPStatus.NOT_FOUND, "there is no protocol file to write to")
            return
        drawn = validate(self.json_object(body), DrawnPatches, "regions").by_name()
        self.send_json(HTTPStatus.OK, {"written": self.server.protocol.write(drawn)})

    def _send_picture(self) -> None:
        seen = self.query("after") or "0"
        picture = self.server.pictures.after(
            int(seen) if seen.isdecimal() and len(seen) < 12 else 0, PICTURE_TIMEOUT_S
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
