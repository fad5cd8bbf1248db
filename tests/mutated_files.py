"""Files that came to harm, or were made to do some, and the commands that read them.

A mutation is a slip of the hand, damage, or one of the things that somebody writes on purpose.
"""

import os
import random
import re
import shutil
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from tests.forked import forked

#: A refusal takes no longer, in seconds of computing; nor does anything hang for longer than this.
QUICK_S, HANG_TIMEOUT_S = 2.0, 60.0
#: Beginnings of lines that are no complaint: progress, notes, and a run that is complete already.
_REMARKS = ("[", "note: ", "warning: ", "nothing to resume: ")

NASTY = [
    b".inf", b"-.inf", b".nan", b"1e400", b"NaN", b"Infinity", b"100000000", b"-1", b"0", b"1e300",
    b"9" * 5000, b"1/0 s", b"1e300 h", b"1e-300 s", b"100000000 h", b"''", b"null", b"[]", b"{}",
    b"!!timestamp x", b"!!python/object/apply:os.system [id]", b"!!binary x", b"!!bool x", b"! x",
    b"&a [*a]", b"&a {b: *a}", b"*nowhere", b"<<: {}", b"? [a]\n: b", b"[" * 2000, b"{" * 2000,
    b'"\\ud800"', b'"\\0"', b"\0", b"\xff\xfe", b"\xed\xa0\x80", b"\xef\xbb\xbf", b"\x85", b"\x0c",
    b"/dev/zero", b"../../x", b"a/" * 3000, b"x" * 300 + b".csv", b"-0", b"--", b"%", b"\t", b"\r",
    b"a: &a [x, x, x, x, x, x, x, x, x]\n"
    + b"".join(b"%c: &%c [%s]\n" % (n, n, b"*%c, " % (n - 1) * 9) for n in range(98, 110)),
]  # fmt: skip
_NUMBER = re.compile(rb"-?\d[\d.]*(?:e-?\d+)?")
_WORD = re.compile(rb"[A-Za-z_./-]+")


@dataclass(frozen=True)
class Victim:
    """A file that is harmed, and the command that reads it."""

    kind: str
    file: Path
    arguments: tuple[object, ...]

    def command(self, file: Path) -> list[str]:
        """What reads it, where the file is now."""
        named = {"FILE": file, "RUN": file.parent}
        return [str(named.get(str(one), one)) for one in self.arguments]


@dataclass(frozen=True)
class Outcome:
    """How a command ended: what was wrong with that, if anything was."""

    code: int
    took_s: float
    wrong: str


def mutated(data: bytes, rng: random.Random) -> bytes:
    """`data`, harmed in one to three places."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        data = rng.choice(_MUTATIONS)(data, rng)
    return data


def _put(data: bytes, start: int, end: int, piece: bytes) -> bytes:
    return data[:start] + piece + data[end:]


def _span(data: bytes, rng: random.Random, longest: int) -> tuple[int, int]:
    start = rng.randrange(len(data) + 1)
    return start, min(start + rng.randint(1, longest), len(data))


def _flip(data: bytes, rng: random.Random) -> bytes:
    return _put(data, *_span(data, rng, 1), bytes([rng.randrange(256)]))


def _cut(data: bytes, rng: random.Random) -> bytes:
    return _put(data, *_span(data, rng, 200), b"")


def _end(data: bytes, rng: random.Random) -> bytes:
    return data[: _span(data, rng, 1)[0]]


def _double(data: bytes, rng: random.Random) -> bytes:
    start, end = _span(data, rng, 200)
    return _put(data, end, end, data[start:end])


def _swap_lines(data: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def _insert(data: bytes, rng: random.Random) -> bytes:
    start, _ = _span(data, rng, 1)
    return _put(data, start, start, rng.choice(NASTY))


def _instead_of(pattern: re.Pattern[bytes]) -> Callable[[bytes, random.Random], bytes]:
    def replace(data: bytes, rng: random.Random) -> bytes:
        found = list(pattern.finditer(data))
        return _put(data, *rng.choice(found).span(), rng.choice(NASTY)) if found else data

    return replace


_MUTATIONS = [
    _flip, _cut, _end, _double, _swap_lines, _insert, _instead_of(_NUMBER), _instead_of(_WORD),
]  # fmt: skip


def victims(run: Path) -> list[Victim]:
    """All that is shipped, and a run folder of a short decay with its result."""
    protocols = list(resources.names("protocols").values())
    optics = resources.folder("config/optics")
    curves = [path for kind in ("csv", "json") for path in sorted(optics.rglob(f"*.{kind}"))]
    rigs = sorted(resources.folder("config").glob("sim*.yaml"))
    materials = sorted(resources.folder("config/materials").glob("*.yaml"))
    predicting = ("plan", run / "protocol.yaml", "--rig", run / "rig.yaml", "--predict")
    return [
        *(
            Victim("protocol", path, ("plan", "FILE", "--rig", "sim-phosphor"))
            for path in protocols
        ),
        *(Victim("rig", path, ("plan", "decay", "--rig", "FILE")) for path in rigs),
        *(Victim("material", path, (*predicting, "FILE")) for path in materials),
        *(Victim("curves", path, ("optics", "show", "FILE")) for path in curves),
        Victim("series", run / "result" / "series.csv", ("fit", "decay", "FILE")),
        Victim("journal", run / "journal.jsonl", ("resume", "RUN", "--no-process")),
        Victim("journal, listed", run / "journal.jsonl", ("runs", "show", "RUN")),
        Victim("run's protocol", run / "protocol.yaml", ("resume", "RUN", "--no-process")),
        Victim("run's rig", run / "rig.yaml", ("resume", "RUN", "--no-process")),
    ]


def try_one(victim: Victim, rng: random.Random, place: Path) -> Outcome:
    """Harm the file in `place`, and have the command read it in a process of its own."""
    folder, said = place / "run", place / "said.txt"
    if "RUN" in victim.arguments:
        shutil.copytree(victim.file.parent, folder)
    else:
        folder.mkdir(parents=True)
    file = folder / victim.file.name
    file.write_bytes(mutated(victim.file.read_bytes(), rng))
    code, took_s = _waited(forked(lambda: guarded(victim.command(file)), said))
    lines = said.read_text(errors="replace").splitlines()
    return Outcome(code, took_s, _wrong(code, took_s, lines))


def _waited(pid: int) -> tuple[int, float]:
    """Exit code and seconds of computing; what hangs is killed."""
    deadline = time.monotonic() + HANG_TIMEOUT_S
    while True:
        done, status, used = os.wait4(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
        if time.monotonic() > deadline:
            os.kill(pid, signal.SIGKILL)
            deadline += HANG_TIMEOUT_S
        time.sleep(0.002)


def _wrong(code: int, took_s: float, lines: Sequence[str]) -> str:
    complaints = [line for line in lines if not line.startswith(_REMARKS)]
    if code not in (0, 2, 4):
        return f"exit code {code}: {complaints[-3:]}"
    if len(complaints) != (code != 0):
        return f"exit code {code}, {len(complaints)} lines: {complaints[:5]}"
    if code and took_s > QUICK_S:
        return f"refused after {took_s:.1f} s: {complaints}"
    return ""
