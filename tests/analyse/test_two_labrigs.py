"""Two labrigs, two real processes, one relay board: the first has it until it ends, even by -9.

The second calls it by a link, relatively, and has another TMPDIR.
"""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from labrig.sim.boards import NumatoBoard
from tests.terminal import on_a_terminal

RIG = """
name: half a bench
devices:
  lamp: {{driver: numato, address: "{address}", relay: 3}}
"""
PATIENCE_S = 60.0


@dataclass
class Wired:
    """A board at a terminal device; `lit` is set when somebody switches its lamp on."""

    address: str
    lit: threading.Event


@pytest.fixture
def wired() -> Iterator[Wired]:
    lit = threading.Event()

    def switched(relay: int, on: bool) -> None:
        if on:
            lit.set()

    with on_a_terminal(NumatoBoard(8, switched)) as address:
        yield Wired(address, lit)


@pytest.mark.campaign
def test_the_second_is_refused_and_the_lock_dies_with_the_first(
    wired: Wired, tmp_path: Path
) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text(RIG.format(address=wired.address))
    command = [sys.executable, "-m", "labrig", "rig", "check", str(rig)]
    link = tmp_path / "by-id"
    link.symlink_to(wired.address)
    (tmp_path / "other.yaml").write_text(RIG.format(address=link.name))
    other = [*command[:-1], "other.yaml"]
    first = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert wired.lit.wait(PATIENCE_S), "the first labrig has the board"
        first.send_signal(signal.SIGSTOP)
        elsewhere = os.environ | {"TMPDIR": str(tmp_path)}
        second = subprocess.run(
            other, capture_output=True, text=True, check=False, cwd=tmp_path, env=elsewhere
        )
        assert second.returncode == 2
        assert second.stdout == ""
        assert second.stderr == (
            "labrig: by-id is held by another labrig on this PC; wait until it has ended\n"
        )
    finally:
        first.kill()
        first.communicate()
    # Its guard has the board for a moment, to switch the lamp off.
    for _ in range(10):
        third = subprocess.run(command, capture_output=True, text=True, check=False)
        if "is held by another labrig" not in third.stderr:
            break
    assert third.returncode == 0, third.stderr
    assert "Numato" in third.stdout
