"""Numbers found again in what a campaign printed."""

import re
from collections.abc import Callable, Iterable

#: From what was printed to what is said of it.
Extract = Callable[[str], str]


def match(pattern: str, printed: str) -> str:
    """Return the first group of the first match."""
    found = re.search(pattern, printed, re.M)
    if found is None:
        raise ValueError(f"not in the output: {pattern}")
    return found[1]


def columns(pattern: str, printed: str) -> list[tuple[float, ...]]:
    """Return the groups of all matches as numbers, column by column."""
    rows = [tuple(map(float, one.groups())) for one in re.finditer(pattern, printed, re.M)]
    if not rows:
        raise ValueError(f"not in the output: {pattern}")
    return list(zip(*rows, strict=True))


def part(printed: str, begin: str) -> str:
    """Return the lines from the one that begins so to the next empty one."""
    return match(rf"(^{re.escape(begin)}(?:.|\n)*?)(?:\n\n|\Z)", printed)


def span(values: Iterable[float], digits: int = 0) -> str:
    """Return the least and the greatest, or the one that both are."""
    known = sorted(values)
    low, high = (f"{value:.{digits}f}" for value in (known[0], known[-1]))
    return low if low == high else f"{low} to {high}"


def furthest(values: Iterable[float]) -> float:
    """Return the largest magnitude."""
    return max(map(abs, values))
