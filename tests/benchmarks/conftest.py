"""Ratios of labrig to its peers, measured turn by turn in one run; no time is ever asserted.

    pytest tests/benchmarks -n 0 --benchmark-only

prints pytest-benchmark's own table and, below it, one line for each peer.
"""

import logging
import os
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import pytest

from tests.conftest import SYNC

Run = Callable[[], object]


@pytest.fixture(autouse=True)
def as_in_the_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are synced here, and all is logged."""
    monkeypatch.setattr("os.fsync", SYNC)
    logging.getLogger("labrig.drivers").setLevel(logging.NOTSET)


@dataclass(frozen=True)
class Times:
    """Median of all rounds, and the shortest: what it takes if nobody else wants the computer."""

    median_s: float
    least_s: float

    def __str__(self) -> str:
        return f"{_text(self.median_s):>8} {'(' + _text(self.least_s) + ')':<10}"


@dataclass(frozen=True)
class Line:
    """What was done and the peer doing the same."""

    what: str
    ours: Times
    peer: str
    theirs: Times

    def __str__(self) -> str:
        ratios = [
            self.ours.median_s / self.theirs.median_s,
            self.ours.least_s / self.theirs.least_s,
        ]
        said = "{:.3g} ({:.3g})".format(*ratios)
        return f"{self.what:<56}{self.ours}  {self.peer:<40}{self.theirs}  {said}"


_HEAD = f"{'median (least) of':<56}{'labrig':<21}{'peer':<42}{'its':<19}  labrig / peer"


_LINES = pytest.StashKey[list[Line]]()


@pytest.fixture
def against(benchmark: Any, request: pytest.FixtureRequest) -> Callable[..., None]:
    """Times something against its peers: `against(ours, {"peer": theirs}, rounds=20)`.

    Each round runs ours and then every peer, so that a busy computer slows them all alike.
    """
    lines = request.config.stash.setdefault(_LINES, [])

    def measure(
        ours: Run, peers: Mapping[str, Run], *, rounds: int, what: str, each: int = 1
    ) -> None:
        """`each`: how many things one call does."""
        contenders = {"": ours, **peers}
        times_s: dict[str, list[float]] = {name: [] for name in contenders}
        for name in contenders:
            contenders[name]()  # imports, caches, plans
        for _ in range(rounds):
            for name, run in contenders.items():
                began_s = time.perf_counter()
                run()
                times_s[name].append((time.perf_counter() - began_s) / each)
        found = {name: Times(statistics.median(s), min(s)) for name, s in times_s.items()}
        lines.extend(Line(what, found[""], name, found[name]) for name in peers)
        benchmark.extra_info |= {
            name or "labrig": {"rounds": rounds, **asdict(times)} for name, times in found.items()
        }
        benchmark.pedantic(ours, rounds=min(rounds, 5))

    return measure


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table."""
    lines = terminalreporter.config.stash.get(_LINES, [])
    if lines:
        load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
        terminalreporter.section(f"labrig against its peers, {os.cpu_count()} CPUs{load}")
        terminalreporter.write_line(_HEAD)
        for line in lines:
            terminalreporter.write_line(str(line))


def _text(seconds: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * scale >= 1:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
