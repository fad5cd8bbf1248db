"""`labrig watch`: a page for the screen outside the dark room."""

from collections.abc import Callable
from pathlib import Path
from typing import Never

from labrig.clock import Clock
from labrig.watch.following import Following
from labrig.watch.server import News, WatchServer

#: Everything is on the page within a second; the folder is looked at more often than that.
LOOK_PERIOD_S = 0.3


def watch_run(run: Path, port: int, clock: Clock, tell: Callable[[str], None]) -> Never:
    """Show a run until somebody stops it; the run itself is not touched.

    Parameters
    ----------
    port
        On 127.0.0.1; 0 for any free one.
    clock
        The PC's.
    tell
        Called once with the page's address.

    Raises
    ------
    Interrupted
        How it ends.
    UsageError
        Not a run folder, or a port that is taken.
    DataError
        The run's journal is damaged.
    """
    following = Following(run)
    following.look()
    news = News(following.state(), following.picture)
    with WatchServer(news, port) as server, server.running():
        try:
            tell(server.url)
            while True:
                if following.look():
                    news.tell(following.state(), following.picture)
                clock.sleep(LOOK_PERIOD_S)
        finally:
            news.end()
