"""The page of `labrig watch`: the state of a run, pushed whenever it changes."""

import json
import threading
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar

from labrig.local_server import LocalConversation, LocalServer

#: A browser that hears nothing for longer takes the connection for dead.
HEARTBEAT_S = 5.0
#: How soon a browser comes back when the connection broke, in ms.
COME_BACK_MS = 500
_HERE = Path(__file__).parent

PAGES: Mapping[str, Path] = {
    name: _HERE / (name or "watch_page.html")
    for name in ("", "watch_page.css", "watch_page.js", "watch_plot.js")
}


class News:
    """The latest state and picture, handed from the thread that follows a run to the browsers."""

    def __init__(self) -> None:
        self._number = 0
        self._state: Mapping[str, Any] = {}
        self._picture: bytes | None = None
        self._is_over = False
        self._changed = threading.Condition()

    @property
    def picture(self) -> bytes | None:
        """The last frame as a JPEG."""
        with self._changed:
            return self._picture

    def tell(self, state: Mapping[str, Any], picture: bytes | None) -> None:
        """Hand on what is new."""
        with self._changed:
            self._number += 1
            self._state, self._picture = state, picture
            self._changed.notify_all()

    def end(self) -> None:
        """There will be no more: nobody waits any longer."""
        with self._changed:
            self._is_over = True
            self._changed.notify_all()

    def after(self, number: int, at_most_s: float) -> tuple[int, Mapping[str, Any]] | None:
        """Number and state later than `number`, waited for; None if nothing came in time.

        Raises
        ------
        EOFError
            There will be no more.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._number > number or self._is_over, at_most_s)
            if self._is_over:
                raise EOFError
            return (self._number, self._state) if self._number > number else None


class WatchServer(LocalServer):
    """Serves the page and what there is to tell.

    Raises
    ------
    UsageError
        The port is taken.
    """

    def __init__(self, news: News, port: int = 0) -> None:
        self.news = news
        super().__init__(port, _Conversation)


class _Conversation(LocalConversation):
    """One connection of a browser."""

    server: WatchServer
    pages: ClassVar[Mapping[str, Path]] = PAGES

    def answer(self, path: str) -> None:
        """The stream of states, or the last frame."""
        if path == "events":
            self._stream()
        elif path == "frame.jpg":
            picture = self.server.news.picture
            if picture is None:
                self.refuse(HTTPStatus.NOT_FOUND, "no frame yet")
            else:
                self.send(HTTPStatus.OK, "image/jpeg", picture)
        else:
            super().answer(path)

    def _stream(self) -> None:
        """Server-sent events: a browser that loses them comes back for more by itself."""
        self.close_connection = True
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        number = 0
        self.wfile.write(f"retry: {COME_BACK_MS}\n\n".encode())
        while True:
            try:
                news = self.server.news.after(number, HEARTBEAT_S)
            except EOFError:
                return
            if news is None:
                self.wfile.write(b": still here\n\n")
            else:
                number, state = news
                self.wfile.write(f"data: {json.dumps(state)}\n\n".encode())
