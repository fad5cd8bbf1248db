"""Web pages served to this PC only: `labrig rig view`, `labrig watch`.

The server is bound to 127.0.0.1; pages of other programs are rejected by a secret in the path, by
the Host header (a foreign name that resolves to 127.0.0.1 would otherwise pass) and by requiring
JSON, which a foreign page cannot send without permission.

It is based on `http.server`: a library would save some fifty lines, and bring a server for
development only (Werkzeug, Bottle) or an event loop besides the threads that hold the camera and
the run (Starlette). The checks would be needed all the same.
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

from labrig.foundation.errors import DiskError, LabrigError, UsageError, memory_shortage
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes

LOOPBACK = "127.0.0.1"
#: No content from other origins, and no embedding in another page.
CONTENT_POLICY = "default-src 'self'; img-src 'self' data:; frame-ancestors 'none'"
#: Connections at once: a page needs a few.
MAX_CONNECTIONS = 64
#: Digits of the length of a request.
LENGTH_DIGITS = 9
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
}


class LocalServer(ThreadingHTTPServer):
    """HTTP server for browsers on this PC.

    Parameters
    ----------
    port
        TCP port; 0 for any free one.
    conversation
        Class that handles the requests of one connection.

    Raises
    ------
    UsageError
        The port is taken.
    """

    daemon_threads = True
    # A browser keeps connections open for minutes; leaving must not wait for them.
    block_on_close = False
    # A connection that finds the queue full is tried again by the system after a second.
    request_queue_size = MAX_CONNECTIONS

    def __init__(self, port: int, conversation: type["RequestHandler"]) -> None:
        self.token = secrets.token_urlsafe(18)
        self._free = threading.BoundedSemaphore(MAX_CONNECTIONS)
        try:
            super().__init__((LOOPBACK, port), conversation)
        except (OSError, OverflowError) as error:
            raise UsageError(
                f"port {port} cannot be used ({error}); leave --port away for any free one"
            ) from None
        self.names = {f"{name}:{self.server_port}" for name in (LOOPBACK, "localhost")}

    def process_request(self, request: Any, client_address: Any) -> None:
        """Converse in a thread; one connection too many is closed."""
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Converse until the connection ends."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    @property
    def url(self) -> str:
        """URL of the page, with the secret."""
        return f"http://{LOOPBACK}:{self.server_port}/{self.token}/"

    @contextmanager
    def running(self) -> Iterator[None]:
        """Serve in a thread."""
        thread = threading.Thread(target=self.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        try:
            yield
        finally:
            self.shutdown()
            self.server_close()
            thread.join()


class RequestHandler(BaseHTTPRequestHandler):
    """Connection of a browser."""

    server: LocalServer
    protocol_version = "HTTP/1.1"
    #: Seconds without a request after which a connection is closed.
    timeout: ClassVar[int] = 60
    #: Longest request that is read.
    max_body_bytes: ClassVar[int] = 64 * 1024
    #: Files beside the class's module by path.
    pages: ClassVar[Mapping[str, Path]] = {}

    def answer(self, path: str) -> None:
        """Answer a GET of a path that is no page."""
        self.refuse(HTTPStatus.NOT_FOUND, "no such thing here")

    def do_GET(self) -> None:
        """Send a page, or the answer to another path."""
        path = self.path_behind_secret()
        if path is None:
            return
        try:
            if path in self.pages:
                page = self.pages[path]
                self.send(HTTPStatus.OK, KINDS[page.suffix], read_bytes(page, MAX_TEXT_BYTES))
            else:
                self.answer(path)
        except LabrigError as error:
            self.refuse(HTTPStatus.BAD_REQUEST, str(error))
        except ConnectionError:
            raise
        except Exception as error:
            self._send_internal_error(error)

    def accept(self, path: str, body: bytes) -> None:
        """Handle a POST."""
        self.refuse(HTTPStatus.NOT_FOUND, "there is nothing to write here")

    def do_POST(self) -> None:
        """Check a POST and handle it."""
        body = self.body()
        path = self.path_behind_secret()
        if path is None:
            return
        try:
            self.accept(path, body)
        except DiskError as error:
            self.refuse(HTTPStatus.INSUFFICIENT_STORAGE, str(error))
        except LabrigError as error:
            self.refuse(HTTPStatus.BAD_REQUEST, str(error))
        except ConnectionError:
            raise
        except Exception as error:
            self._send_internal_error(error)

    def _send_internal_error(self, error: Exception) -> None:
        """Say that labrig is at fault: without an answer a page would take it for gone."""
        if isinstance(error, MemoryError):
            self.refuse(HTTPStatus.INSUFFICIENT_STORAGE, str(memory_shortage(error)))
            return
        self.refuse(
            HTTPStatus.INTERNAL_SERVER_ERROR,
            f"a fault in labrig itself ({error!r:.200}); please report it",
        )

    def path_behind_secret(self) -> str | None:
        """Return the path behind the secret, or None after a refusal."""
        if self.headers.get("Host", "") not in self.server.names:
            self.refuse(HTTPStatus.FORBIDDEN, f"this page is called {LOOPBACK} only")
            return None
        try:
            whole = urlsplit(self.path).path
        except ValueError:
            self.refuse(HTTPStatus.BAD_REQUEST, "this is no address")
            return None
        token, slash, path = whole.removeprefix("/").partition("/")
        if not slash or not secrets.compare_digest(token.encode(), self.server.token.encode()):
            self.refuse(HTTPStatus.FORBIDDEN, "use the whole address that labrig printed")
            return None
        return path

    def query(self, key: str) -> str | None:
        """Return the value of a query key, the last one if it occurs several times."""
        values = parse_qs(urlsplit(self.path).query).get(key)
        return values[-1] if values else None

    def body(self) -> bytes:
        """Read the request's body, also of a refused request, to keep the connection usable."""
        length = self.headers.get("Content-Length", "")
        # Python refuses to convert thousands of digits.
        is_number = length.isdecimal() and len(length) <= LENGTH_DIGITS
        if not is_number or int(length) > self.max_body_bytes:
            self.close_connection = True
            return b""
        return self.rfile.read(int(length))

    def json_object(self, body: bytes) -> dict[str, Any]:
        """Return the JSON object in `body`.

        Raises
        ------
        UsageError
            The body is no JSON object, or not declared as JSON.
        """
        kind = self.headers.get("Content-Type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            raise UsageError(f"expected application/json, got {kind or 'nothing'}")
        try:
            content = json.loads(body)
        except (ValueError, RecursionError) as error:
            raise UsageError(f"expected JSON, got something else ({error})") from None
        if not isinstance(content, dict):
            raise UsageError("expected a JSON object")
        return content

    def refuse(self, status: HTTPStatus, text: str) -> None:
        """Send an error in one line."""
        self.send_json(status, {"error": " ".join(text.split())})

    def send_json(self, status: HTTPStatus, content: Mapping[str, Any]) -> None:
        """Send `content` as JSON."""
        self.send(status, "application/json", json.dumps(content).encode())

    def send(
        self,
        status: HTTPStatus,
        kind: str,
        data: bytes,
        more: Mapping[str, str] | None = None,
        policy: str = CONTENT_POLICY,
    ) -> None:
        """Send `data` of a content type, with further headers, under a content security policy."""
        self.send_response(status)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Length", str(len(data))),
            ("Cache-Control", "no-store"),
            ("Content-Security-Policy", policy),
            ("Referrer-Policy", "no-referrer"),
            ("X-Content-Type-Options", "nosniff"),
            *(more or {}).items(),
        ):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def handle(self) -> None:
        """Handle requests; a browser that disconnects is no error."""
        try:
            super().handle()
        except ConnectionError:
            self.close_connection = True

    def log_message(self, format: str, *args: Any) -> None:
        """Suppress logging: the address contains the secret."""
