"""Very many answers of boards that come to harm on their serial line.

    python -m tests.acceptance.serial_fuzz [--cases 10000] [--seed 1] [--board NAME [--case N]]

Each case is a driver on an emulated board; up to half of the answers are changed, cut, lost,
repeated, late by one, or garbage, while the driver does random actions. Wanted: each action ends
within about two minutes of lab time, with a result or with one error of a device in one line; a
light that was switched off without an error is off. Once the line is in order, at the second
attempt at the latest, all is safe and the driver says so.
"""

import argparse
import random
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from labrig.acquire import load_driver
from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import DeviceError
from labrig.foundation.yaml_file import validate
from labrig.sim.boards import (
    ArduinoBoard,
    ChangerBoard,
    CornerstoneBoard,
    Dc4100Board,
    Fw102cBoard,
    LcusBoard,
    MaestroBoard,
    NumatoBoard,
)
from tests.drivers.serial_wire import Board, BoardPort, Wired

#: For two minutes labrig waits for a robot that changes the sample.
MAX_S = 125.0
#: Longest garbage; a line is some tens of bytes.
GARBAGE_BYTES = 400
RELAY = {
    "on": {"send": "on 0", "answer": "ok"},
    "off": {"send": "off 0", "answer": "ok"},
    "state": {"send": "state 0", "on": "on", "off": "off"},
}
DOOR = {"channel": 0, "closed": "1000 us", "open": "1500 us", "travel": "20 ms"}
HARMS: dict[str, Callable[[random.Random, bytes, bytes], bytes]] = {
    "bits flipped": lambda rng, answer, _: _with_bits_flipped(rng, answer),
    "cut": lambda rng, answer, _: answer[: rng.randrange(len(answer) + 1)],
    "begins late": lambda rng, answer, _: answer[rng.randrange(len(answer) + 1) :],
    "lost": lambda *_: b"",
    "the one before": lambda _, __, before: before,
    "with the one before": lambda _, answer, before: before + answer,
    "twice": lambda _, answer, __: answer * 2,
    "garbage": lambda rng, *_: rng.randbytes(rng.randint(1, GARBAGE_BYTES)),
    "garbage before": lambda rng, answer, _: rng.randbytes(rng.randint(1, 40)) + answer,
    "a digit changed": lambda rng, answer, _: bytes(
        rng.choice(b"0123456789-.e") if chr(byte).isdigit() and rng.random() < 0.5 else byte
        for byte in answer
    ),
}


def _with_bits_flipped(rng: random.Random, answer: bytes) -> bytes:
    flipped = bytearray(answer)
    for _ in range(rng.randint(1, 4) if answer else 0):
        flipped[rng.randrange(len(answer))] ^= 1 << rng.randrange(8)
    return bytes(flipped)


class Harmed:
    """A board whose answers come to harm, each with a probability of `risk`."""

    def __init__(self, board: Board, rng: random.Random, risk: float, tally: Counter[str]) -> None:
        self._board, self._rng, self.risk, self._tally = board, rng, risk, tally
        self._before = b""

    def receive(self, data: bytes) -> bytes:
        answer = self._board.receive(data)
        before, self._before = self._before, answer
        if self._rng.random() >= self.risk:
            return answer
        name = self._rng.choice(list(HARMS))
        self._tally[name] += 1
        return HARMS[name](self._rng, answer, before)


@dataclass(frozen=True)
class Kind:
    """A driver, its emulated board, what it does, and whether a light of it is lit.

    Attributes
    ----------
    role, driver, keys
        As in a rig file.
    board
        Function that makes the board.
    actions
        Calls of the driver.
    is_lit
        Function of the board; None where it has no light.
    """

    role: str
    driver: str
    keys: dict[str, Any]
    board: Callable[[VirtualClock], Any]
    actions: Sequence[Callable[[Any], object]]
    is_lit: Callable[[Any], bool] | None = None


class Heads:
    """LED heads on the outputs of a unit."""

    def __init__(self) -> None:
        self.lit: dict[int, bool] = {}

    def switch(self, output: int, on: bool) -> None:
        self.lit[output] = on

    def dim(self, output: int, fraction: float) -> None:
        pass


def _dc4100(_: VirtualClock) -> Dc4100Board:
    heads = Heads()
    board = Dc4100Board(heads, {0: 455.0, 3: 530.0})
    setattr(board, "heads", heads)  # noqa: B010
    return board


def _off(driver: Any) -> None:
    driver.off()


def _dark(driver: Any) -> None:
    driver.dark()


LAMP = (lambda d: d.on(), _off, _off, lambda d: d.is_on(), lambda d: d.identity())
KINDS = {
    "numato": Kind(
        *("lamp", "numato", {"relay": 0}, lambda clock: NumatoBoard(8, lambda *_: None), LAMP),
        lambda board: bool(board.states[0]),
    ),
    "lcus": Kind(
        *("lamp", "lcus", {"relay": 1}, lambda clock: LcusBoard(2, lambda *_: None, "text"), LAMP),
        lambda board: bool(board.states[0]),
    ),
    "serial_relay": Kind(
        *("lamp", "serial_relay", RELAY, lambda clock: ArduinoBoard(2, lambda *_: None, clock)),
        LAMP,
        lambda board: bool(board.states[0]),
    ),
    "dc4100": Kind(
        *("leds", "thorlabs_dc4100", {"channels": {"a": {"output": 1}, "b": {"output": 4}}}),
        _dc4100,
        (
            *(lambda d: d.light("a"), lambda d: d.light("b"), _dark, _dark),
            *(lambda d: d.channel_on(), lambda d: d.identity()),
        ),
        lambda board: any(board.heads.lit.values()),
    ),
    "maestro": Kind(
        *("door", "maestro", DOOR, lambda clock: MaestroBoard(clock, {0: 1000e-6})),
        (lambda d: d.swing(safe=False), lambda d: d.swing(safe=True), lambda d: d.identity()),
    ),
    "thermometer": Kind(
        *("thermometer", "numato", {}),
        lambda clock: NumatoBoard(8, lambda *_: None, {0: lambda: 0.72}),
        (lambda d: d.celsius(), lambda d: d.identity()),
    ),
    "fw102c": Kind(
        *("filter_wheel", "thorlabs_fw102c", {"filters": {"a": 2, "b": 4}}),
        lambda clock: Fw102cBoard(lambda slot: None, clock),
        (lambda d: d.put("a"), lambda d: d.put("b"), lambda d: d.identity()),
    ),
    "cornerstone": Kind(
        *("monochromator", "oriel_cornerstone", {"fwhm": 10.0, "travel": "8 s"}),
        lambda clock: CornerstoneBoard(lambda nm, is_open: None, clock),
        (lambda d: d.tune(600.0), lambda d: d.limits_nm(), lambda d: d.identity()),
    ),
    "changer": Kind(
        *("changer", "text_changer", {}),
        lambda clock: ChangerBoard({"fresh sample": lambda: None}),
        (lambda d: d.do("fresh sample"), lambda d: d.identity()),
    ),
}


def try_one(kind: Kind, rng: random.Random, ended: Counter[str], harmed: Counter[str]) -> str:
    """Return what went wrong with one board."""
    clock = VirtualClock()
    board = kind.board(clock)
    line = Harmed(board, rng, 0.0, harmed)
    driver_class: Any = load_driver(kind.role, kind.driver, "rig.yaml")
    settings = validate(kind.keys, driver_class.Settings, "rig.yaml")
    driver = driver_class("COM3", settings, Wired(clock, BoardPort(clock, line)))
    driver.make_safe()
    line.risk = rng.choice((0.02, 0.1, 0.5))
    for _ in range(rng.randint(1, 8)):
        action, begin_s = rng.choice(list(kind.actions)), clock.now()
        try:
            action(driver)
            ended["done"] += 1
        except DeviceError as error:
            ended[type(error).__name__] += 1
            if "\n" in str(error):
                return f"more than a line: {error!r}"
        except Exception as error:
            return repr(error)
        else:
            if action in (_off, _dark) and kind.is_lit is not None and kind.is_lit(board):
                return "it is lit, and was switched off without an error"
        if clock.now() - begin_s > MAX_S:
            return f"took {clock.now() - begin_s:.0f} s"
    line.risk = 0.0
    for last in (False, True):
        try:
            driver.make_safe()
            break
        except DeviceError as error:
            if last:
                return f"not safe on a sound line: {error}"
    if kind.is_lit is not None and kind.is_lit(board):
        return "it is lit, and was made safe without an error"
    return ""


def main() -> None:
    """Print a line for each board, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--board", choices=list(KINDS))
    parser.add_argument("--case", type=int)
    asked = parser.parse_args()
    wrong: list[str] = []
    number = 0
    print("board          cases  answers harmed  wrong  actions")
    for name in [asked.board] if asked.board else KINDS:
        ended: Counter[str] = Counter()
        harmed: Counter[str] = Counter()
        cases = range(asked.cases) if asked.case is None else [asked.case]
        before, began_s = len(wrong), perf_counter()
        for case in cases:
            rng = random.Random(f"{asked.seed} {name} {case}")
            if said := try_one(KINDS[name], rng, ended, harmed):
                wrong.append(f"{name}, case {case}: {said}")
        number += len(cases)
        print(
            f"{name:13}{len(cases):7}{harmed.total():16}{len(wrong) - before:7}  "
            f"{', '.join(f'{count} {what}' for what, count in ended.most_common())}",
            flush=True,
        )
        print(f"{name}: {perf_counter() - began_s:.0f} s", file=sys.stderr)
    print(f"{len(wrong)} of {number} went wrong", *wrong[:20], sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
