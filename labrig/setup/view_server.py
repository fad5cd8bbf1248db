"""The page of `labrig rig view`, served to this PC alone.

Bound to 127.0.0.1; other programs' pages are kept out by a secret in the path, by the Host header
(a foreign name that resolves to 127.0.0.1 would otherwise do) and by asking for JSON, which a
foreign page cannot send without being allowed to.
"""

import json
import secrets
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import parse_qs, urlsplit

from labrig.errors import DiskError, LabrigError, UsageError
from labrig.region import Region, parse_region
from labrig.setup.aimed_protocol import AimedProtocol
from labrig.setup.drawn_patches import DrawnPatches
from labrig.setup.live_pictures import LivePictures
from labrig.setup.picture_stats import decode, picture_stats
from labrig.yaml_file import validate

LOOPBACK = "127.0.0.1"
#: How long a browser waits for a picture before it is told to ask again.
PICTURE_TIMEOUT_S = 10.0
MOST_BODY_BYTES = 64 * 1024
#: Nothing from anywhere else, and not inside another page.
CONTENT_POLICY = "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'"

PAGE: Mapping[str, tuple[str, str]] = {
    "": ("view_page.html", "text/html; charset=utf-8"),
    "view_page.css": ("view_page.css", "text/css; charset=utf-8"),
    "view_page.js": ("view_page.js", "text/javascript; charset=utf-8"),
    "view_regions.js": ("view_regions.js", "text/javascript; charset=utf-8"),
}


class ViewServer(ThreadingHTTPServer):
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

    daemon_threads = True
    # A browser keeps connections open for minutes; leaving must not wait for them.
    block_on_close = False

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
        self.token = secrets.token_urlsafe(18)
        try:
            super().__init__((LOOPBACK, port), _Conversation)
        except (OSError, OverflowError) as error:
            raise UsageError(
                f"port {port} cannot be used ({error}); leave --port away for any free one"
            ) from None
        self.names = {f"{name}:{self.server_port}" for name in (LOOPBACK, "localhost")}

    @property
    def url(self) -> str:
        """Where the page is, the secret included."""
        return f"http://{LOOPBACK}:{self.server_port}/{self.token}/"

    @contextmanager
    def running(self) -> Iterator[None]:
        """Answer in a thread of its own."""
        thread = threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        try:
            yield
        finally:
            self.shutdown()
            self.server_close()
            thread.join()


class _Conversation(BaseHTTPRequestHandler):
    """One connection of a browser."""

    server: ViewServer
    protocol_version = "HTTP/1.1"
    #: A connection on which nothing is asked for so long is given up.
    timeout: ClassVar[int] = 60

    def do_GET(self) -> None:
        """Page, picture, statistics or regions."""
        path = self._path()
        if path is None:
            return
        try:
            if path in PAGE:
                name, kind = PAGE[path]
                self._send(HTTPStatus.OK, kind, (Path(__file__).parent / name).read_bytes())
            elif path == "frame.jpg":
                self._send_picture()
            elif path == "stats":
                self._send_stats()
            elif path == "patches":
                self._send_json(HTTPStatus.OK, self._patches())
            else:
                self._refuse(HTTPStatus.NOT_FOUND, "no such thing here")
        except LabrigError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))

    def do_POST(self) -> None:
        """Write the regions."""
        body = self._body()
        path = self._path()
        if path is None:
            return
        if path != "patches" or self.server.protocol is None:
            self._refuse(HTTPStatus.NOT_FOUND, "there is no protocol file to write to")
            return
        try:
            written = self.server.protocol.write(self._drawn(body))
        except DiskError as error:
            self._refuse(HTTPStatus.INSUFFICIENT_STORAGE, str(error))
        except LabrigError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        else:
            self._send_json(HTTPStatus.OK, {"written": written})

    def _path(self) -> str | None:
        """Path behind the secret, or None after having refused."""
        if self.headers.get("Host", "") not in self.server.names:
            self._refuse(HTTPStatus.FORBIDDEN, f"this page is called {LOOPBACK} only")
            return None
        token, slash, path = urlsplit(self.path).path.removeprefix("/").partition("/")
        if not slash or not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN, "use the whole address that labrig printed")
            return None
        return path

    def _query(self, key: str) -> str | None:
        values = parse_qs(urlsplit(self.path).query).get(key)
        return values[-1] if values else None

    def _send_picture(self) -> None:
        seen = self._query("after") or "0"
        picture = self.server.pictures.after(
            int(seen) if seen.isdecimal() and len(seen) < 12 else 0, PICTURE_TIMEOUT_S
        )
        if picture is None:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "no live picture yet")
            return
        self._send(HTTPStatus.OK, "image/jpeg", picture.jpeg, {"X-Picture": str(picture.number)})

    def _send_stats(self) -> None:
        latest = self.server.pictures.latest
        if latest is None:
            self._refuse(HTTPStatus.SERVICE_UNAVAILABLE, "no live picture yet")
            return
        text = self._query("region")
        region = None if text is None else parse_region(text)
        stats = picture_stats(decode(latest.jpeg), region)
        self._send_json(HTTPStatus.OK, {"number": latest.number, **stats.to_json()})

    def _patches(self) -> dict[str, Any]:
        protocol = self.server.protocol
        return {
            "rig": self.server.rig_name,
            "protocol": None if protocol is None else protocol.path.name,
            "patches": [] if protocol is None else protocol.in_fractions(),
            "in_pixels": [] if protocol is None else protocol.in_pixels(),
        }

    def _drawn(self, body: bytes) -> dict[str, Region]:
        kind = self.headers.get("Content-Type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            raise UsageError(f"expected application/json, got {kind or 'nothing'}")
        try:
            content = json.loads(body)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"expected JSON, got something else ({error})") from None
        if not isinstance(content, dict):
            raise UsageError("expected a JSON object with the key 'patches'")
        return validate(content, DrawnPatches, "regions").by_name()

    def _body(self) -> bytes:
        """What was sent along, read even if it is refused: the connection goes on."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > MOST_BODY_BYTES:
            self.close_connection = True
            return b""
        return self.rfile.read(int(length))

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        self._send_json(status, {"error": " ".join(text.split())})

    def _send_json(self, status: HTTPStatus, content: Mapping[str, Any]) -> None:
        self._send(status, "application/json", json.dumps(content).encode())

    def _send(
        self,
        status: HTTPStatus,
        kind: str,
        data: bytes,
        more: Mapping[str, str] | None = None,
    ) -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(data))),
            ("Cache-Control", "no-store"),
            ("Content-Security-Policy", CONTENT_POLICY),
            ("Referrer-Policy", "no-referrer"),
            ("X-Content-Type-Options", "nosniff"),
            *(more or {}).items(),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def handle(self) -> None:
        """As inherited; a browser that goes away in the middle is no fault."""
        try:
            super().handle()
        except ConnectionError:
            self.close_connection = True

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: the address, which has the secret in it, is not written anywhere."""
