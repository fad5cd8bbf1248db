"""Ratios of labrig to its peers, measured turn by turn in one run; no time is ever asserted.

    pytest tests/benchmarks --benchmark-only

prints pytest-benchmark's own table and, below it, one line for each peer.
"""

import gc
import os
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import pytest

Run = Callable[[], object]


@dataclass(frozen=True)
class Line:
    """Medians of what was done and of the peer doing the same, in seconds for each of `what`."""

    what: str
    peer: str
    ours_s: float
    peer_s: float

    def __str__(self) -> str:
        ours, peer = self.ours_s, self.peer_s
        said = f"{peer / ours:.1f} x faster" if ours < peer else f"{ours / peer:.2f} x as long"
        return f"{self.what:<58}{_text(ours):>10}   {self.peer:<44}{_text(peer):>10}   {said}"


_LINES = pytest.StashKey[list[Line]]()


@pytest.fixture
def against(benchmark: Any, request: pytest.FixtureRequest) -> Callable[..., None]:
    """Times something against its peers: `against(ours, {"peer": theirs}, rounds=20)`.

    Each round runs ours and then every peer, so that a busy computer slows them all alike.
    """
    lines = request.config.stash.setdefault(_LINES, [])

    def measure(
        ours: Run, peers: Mapping[str, Run], *, rounds: int, what: str = "", each: int = 1
    ) -> None:
        """`each`: how many things one call does."""
        what = what or request.node.name.removeprefix("test_").replace("_", " ")
        contenders = {"": ours, **peers}
        times_s: dict[str, list[float]] = {name: [] for name in contenders}
        for name in contenders:
            contenders[name]()  # imports, caches, plans
        for _ in range(rounds):
            for name, run in contenders.items():
                gc.collect()
                began_s = time.perf_counter()
                run()
                times_s[name].append((time.perf_counter() - began_s) / each)
        median_s = {name: statistics.median(times) for name, times in times_s.items()}
        least_s = {name: min(times) for name, times in times_s.items()}
        for name in peers:
            lines.append(Line(what, name, median_s[""], median_s[name]))
        benchmark.extra_info.update(
            rounds=rounds,
            each=each,
            median_s={name or "labrig": value for name, value in median_s.items()},
            least_s={name or "labrig": value for name, value in least_s.items()},
            ratios={name: median_s[name] / median_s[""] for name in peers},
        )
        benchmark.pedantic(ours, rounds=min(rounds, 5))

    return measure


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table."""
    lines = terminalreporter.config.stash.get(_LINES, [])
    if lines:
        load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
        terminalreporter.section(f"labrig against its peers, medians, {os.cpu_count()} CPUs{load}")
        for line in lines:
            terminalreporter.write_line(str(line))


def _text(seconds: float) -> str:
    for unit, scale in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * scale >= 1:
            return f"{seconds * scale:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
