"""Server of the page of `labrig watch`, which sends every change of a run's state."""

import json
import re
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar, Never

from labrig.foundation.clock import Clock
from labrig.foundation.input_file import read_bytes, read_text
from labrig.foundation.signals import interrupting
from labrig.local_server import KINDS, LocalServer, RequestHandler
from labrig.record import require_plain_folder
from labrig.watch.run_follower import RunFollower

#: Period of messages without which a browser takes the connection for dead.
HEARTBEAT_S = 5.0
#: Time after which a browser reconnects, in ms.
RECONNECT_MS = 500
_HERE = Path(__file__).parent
_PAGE = _HERE / "watch_page.html"
#: Placeholder in the page for the first update.
_FIRST_UPDATE = "FIRST_NEWS"

PAGES: Mapping[str, Path] = {
    name: _HERE / name
    for name in (
        "watch_page.css",
        "watch_page.js",
        "watch_units.js",
        "watch_words.js",
        "watch_plot.js",
    )
}

#: Report of a run and its figures, as its page links to them.
_RESULT = re.compile(r"result/(report\.html|figures/[\w-]+\.svg)")
_KINDS = KINDS | {".svg": "image/svg+xml"}
MAX_REPORT_BYTES = 200_000_000
#: A report has all that it shows within itself.
REPORT_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
    "frame-ancestors 'none'"
)

#: Section → key → value; None for a value that no longer exists.
Things = Mapping[str, Mapping[str, Any]]


class UpdateFeed:
    """State of a run, passed from the thread that follows it to the browsers.

    Every value is kept with the number of the update that changed it last. A browser that names the
    last number it received gets all later values, be it one frame or the whole run.

    Parameters
    ----------
    state
        Whole state: section → key → value.
    picture
        Latest frame as a JPEG.
    """

    def __init__(self, state: Things, picture: bytes | None) -> None:
        self._number = 0
        self._values: dict[tuple[str, str], tuple[int, Any]] = {}
        self._picture: bytes | None = None
        self._has_ended = False
        self._changed = threading.Condition()
        self.tell(state, picture)

    @property
    def picture(self) -> bytes | None:
        """Latest frame as a JPEG."""
        with self._changed:
            return self._picture

    def tell(self, state: Things, picture: bytes | None) -> None:
        """Publish the present state."""
        now = {
            (section, key): value
            for section, things in state.items()
            for key, value in things.items()
        }
        with self._changed:
            self._number += 1
            for place in [*now, *self._values]:
                value = now.get(place)
                if place not in self._values or self._values[place][1] != value:
                    self._values[place] = (self._number, value)
            self._picture = picture
            self._changed.notify_all()

    def end(self) -> None:
        """End the feed and release all browsers that wait."""
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()

    def after(self, number: int, at_most_s: float) -> tuple[int, Things] | None:
        """Return the values updated after `number`, with the last number; None on a time-out.

        Raises
        ------
        EOFError
            If the feed has ended.
        """
        with self._changed:
            if number > self._number:  # of another watch: nothing is known
                number = 0
            self._changed.wait_for(lambda: self._number > number or self._has_ended, at_most_s)
            if self._has_ended:
                raise EOFError
            if self._number <= number:
                return None
            things: dict[str, dict[str, Any]] = {}
            for (section, key), (changed_number, value) in self._values.items():
                if changed_number > number:
                    things.setdefault(section, {})[key] = value
            return self._number, things


class WatchServer(LocalServer):
    """Server of the page, of the updates, and of the report once there is one.

    Parameters
    ----------
    run
        Run folder, for its report.
    news
        Updates of the run's state.
    port
        TCP port on 127.0.0.1; 0 for any that is free.

    Raises
    ------
    UsageError
        If the port is taken.
    """

    def __init__(self, run: Path, news: UpdateFeed, port: int = 0) -> None:
        self.run, self.news = run, news
        super().__init__(port, _Conversation)


class _Conversation(RequestHandler):
    """A connection of a browser."""

    server: WatchServer
    pages: ClassVar[Mapping[str, Path]] = PAGES

    def answer(self, path: str) -> None:
        """Send the page, the stream of updates, the latest frame, or the report."""
        if path == "":
            self._send_page()
        elif path == "events":
            self._stream()
        elif path == "frame.jpg":
            picture = self.server.news.picture
            if picture is None:
                self.refuse(HTTPStatus.NOT_FOUND, "no frame yet")
            else:
                self.send(HTTPStatus.OK, "image/jpeg", picture)
        elif found := _RESULT.fullmatch(path):
            self._send_result(found[1])
        else:
            super().answer(path)

    def _send_result(self, name: str) -> None:
        """Send the report or one of its figures; whoever made it, it reaches nothing else."""
        folder = self.server.run / "result"
        require_plain_folder(folder)
        content = read_bytes(folder / name, MAX_REPORT_BYTES)
        self.send(HTTPStatus.OK, _KINDS[Path(name).suffix], content, policy=REPORT_POLICY)

    def _send_page(self) -> None:
        """Send the page with the present state of the run in it, so that it is never empty."""
        try:
            first = _message(self.server.news.after(0, 0.0))
        except EOFError:
            self.refuse(HTTPStatus.SERVICE_UNAVAILABLE, "labrig watch is ending")
            return
        # a name in it must not end the element that it stands in
        page = read_text(_PAGE).replace(_FIRST_UPDATE, first.replace("<", "\\u003c"))
        self.send(HTTPStatus.OK, KINDS[".html"], page.encode())

    def _stream(self) -> None:
        """Send updates as server-sent events; a browser that loses the connection resumes."""
        self.close_connection = True
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(f"retry: {RECONNECT_MS}\n\n".encode())
        last_id = self.headers.get("Last-Event-ID") or self.query("after") or "0"
        number = int(last_id) if last_id.isdecimal() and len(last_id) < 12 else 0
        while True:
            try:
                news = self.server.news.after(number, HEARTBEAT_S)
            except EOFError:
                return
            if news is None:
                self.wfile.write(b": still here\n\n")
            else:
                number = news[0]
                self.wfile.write(f"id: {number}\ndata: {_message(news)}\n\n".encode())


def _message(news: tuple[int, Things] | None) -> str:
    number, things = news or (0, {})
    return json.dumps({"number": number, "things": things})


#: Period of reading the folder, so that news are on the page within a second.
LOOK_PERIOD_S = 0.3


def watch_run(run: Path, port: int, clock: Clock, tell: Callable[[str], None]) -> Never:
    """Show a run in the browser while it is recorded, until it is interrupted.

    The run itself is only read.

    Parameters
    ----------
    run
        Run folder.
    port
        TCP port on 127.0.0.1; 0 for any that is free.
    clock
        Clock of the PC; its waits are where an interruption is answered.
    tell
        Function that is called once, with the address of the page.

    Raises
    ------
    Interrupted
        On Ctrl-C.
    UsageError
        If this is not a run folder, or the port is taken.
    DataError
        If the journal of the run is damaged.

    Examples
    --------
    >>> import signal
    >>> from pathlib import Path
    >>> from labrig.foundation.clock import Interrupted, SystemClock
    >>> from labrig.watch import watch_run
    >>> clock = SystemClock()
    >>> def tell(url):
    ...     print(url.partition(":")[0])
    ...     clock.interrupt(signal.SIGINT)  # Ctrl-C, as soon as the page is served
    >>> try:
    ...     watch_run(Path("runs/decay"), 0, clock, tell)
    ... except Interrupted:
    ...     print("stopped")
    http
    stopped
    """
    follower = RunFollower(run)
    follower.look()
    news = UpdateFeed(follower.state(), follower.picture)
    with interrupting(clock), WatchServer(run, news, port) as server, server.running():
        try:
            tell(server.url)
            while True:
                if follower.look():
                    news.tell(follower.state(), follower.picture)
                clock.sleep(LOOK_PERIOD_S)
        finally:
            news.end()
