"""Progress of long work, for a display at the terminal or for none."""

from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

from labrig.foundation.clock import SystemClock

T = TypeVar("T")


@dataclass(eq=False)
class Activity:
    """A piece of work that may take seconds.

    Attributes
    ----------
    what
        Work as text, such as `reducing frames`.
    total
        Number of steps; 0 if it is not known.
    done
        Number of steps that are done.
    began_s
        Begin in seconds of the PC's clock.
    """

    what: str
    total: int = 0
    done: int = 0
    began_s: float = field(default_factory=lambda: SystemClock().now())

    def restart(self, what: str, total: int = 0) -> None:
        """Go on with other work."""
        self.what, self.total, self.done = what, total, 0
        self.began_s = SystemClock().now()

    def left_s(self, now_s: float) -> float | None:
        """Return how long it still takes, by the steps so far; None where that is not known."""
        if not 0 < self.done <= self.total:
            return None
        return (now_s - self.began_s) / self.done * (self.total - self.done)


#: Work under way, each a part of the one before it.
_under_way: list[Activity] = []
#: What is called after each counted step, such as a look for an interruption.
_checkpoints: list[Callable[[], None]] = []


@contextmanager
def checking(check: Callable[[], None]) -> Iterator[None]:
    """Call a function after each counted step, so that long work can be interrupted.

    Parameters
    ----------
    check
        Function that raises an exception where the work is to end.

    Yields
    ------
    None
        Nothing; the function is called until the block ends.

    Examples
    --------
    >>> from labrig.foundation.activity import checking, counted
    >>> with checking(lambda: print("go on")):
    ...     letters = list(counted("ab", "reading letters"))
    go on
    go on
    """
    _checkpoints.append(check)
    try:
        yield
    finally:
        _checkpoints.remove(check)


def under_way() -> tuple[Activity, ...]:
    """Return the work under way, from the whole to its part.

    Returns
    -------
    tuple of Activity
        Activities; none if nothing takes long.

    Examples
    --------
    >>> from labrig.foundation.activity import activity, under_way
    >>> with activity("fitting"):
    ...     [each.what for each in under_way()]
    ['fitting']
    """
    return tuple(_under_way)


@contextmanager
def activity(what: str, total: int = 0) -> Iterator[Activity]:
    """Name work that may take seconds.

    Parameters
    ----------
    what
        Work as text.
    total
        Number of steps; 0 if it is not known.

    Yields
    ------
    Activity
        The work, whose `done` counts its steps.

    Examples
    --------
    >>> from labrig.foundation.activity import activity
    >>> with activity("fitting", 4) as fitting:
    ...     fitting.done = 1
    ...     round(fitting.left_s(fitting.began_s + 2.0), 6)
    6.0
    """
    started = Activity(what, total)
    _under_way.append(started)
    try:
        yield started
    finally:
        _under_way.remove(started)


def counted(items: Iterable[T], what: str, total: int = 0) -> Iterator[T]:
    """Yield items and count them as steps of work.

    Parameters
    ----------
    items
        Items, each of which is worked on until the next one is asked for.
    what
        Work as text.
    total
        Number of items, where they do not have a length.

    Yields
    ------
    object
        The items.

    Examples
    --------
    >>> from labrig.foundation.activity import counted, under_way
    >>> [under_way()[-1].done for _ in counted("abc", "reading letters")]
    [0, 1, 2]
    """
    with activity(what, len(items) if isinstance(items, Sized) else total) as work:
        for item in items:
            yield item
            work.done += 1
            for check in _checkpoints:
                check()
