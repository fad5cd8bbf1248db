"""All commands of the README in encodings that lack their characters, piped and on a terminal.

    python -m tests.acceptance.encodings [--encodings NAME ...] [--rows TEXT ...]

Every command runs in a process of its own, samples have names in Chinese, Greek and emoji. Wrong
are another exit code than the expected one, output that is none in its encoding, and what looks
like a fault. `--rows` runs the commands that contain one of the texts, after the first, on whose
run others work.
"""

import argparse
import os
import pty
import select
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from labrig.foundation import resources

MAX_S = 900.0
SERVES_S = 20.0

ENCODINGS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "cp1252": ("cp1252", {"PYTHONIOENCODING": "cp1252"}),
    "ascii": ("ascii", {"PYTHONIOENCODING": "ascii"}),
    "latin-1": ("latin-1", {"PYTHONIOENCODING": "latin-1"}),
    "LC_ALL=C": ("ascii", {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
}
PROTOCOL = """protocol: decay
sample: {name: 样品 😀 σ/batch-3.1}
charge: 15 min
for: 60 s
exposure: 1 s
"""
QUEUE = "runs: [{protocol: ./my-decay.yaml, rig: sim, set: {for: 30 s, sample.name: Λ-é}}]\n"
TABLE = "time_s,σ\n" + "".join(f"{t},{1000 * 0.9**t:.4f}\n" for t in range(40))


@dataclass(frozen=True)
class Command:
    """A command line after `labrig`, and how it ends; one that serves a page is told to end."""

    line: str
    code: int = 0
    serves: bool = False


COMMANDS = (
    Command("run ./my-decay.yaml --rig ./my-rig.yaml"),
    Command("--help"),
    Command("run --help"),
    Command("fit decay --help"),
    Command("run decay --rig sim"),
    Command("run decay --rig sim --verbose"),
    Command("rig devices"),
    Command("rig check ./my-rig.yaml"),
    Command("rig check ./my-rig.yaml --verbose"),
    Command("rig view ./my-rig.yaml --protocol ./my-decay.yaml --no-browser", 143, serves=True),
    Command("protocol list"),
    Command("protocol new decay new-decay.yaml"),
    Command("plan ./my-decay.yaml --rig ./my-rig.yaml"),
    Command("plan ./my-decay.yaml --rig ./my-rig.yaml --predict blue-paint"),
    Command("watch --no-browser", 143, serves=True),
    Command("rig use ./my-rig.yaml"),
    Command("rig use --forget"),
    Command("resume last"),
    Command("process last"),
    Command("process last --law stretched"),
    Command("note last text"),
    Command("runs"),
    Command("runs show last"),
    Command("figures last"),
    Command("reproduce last"),
    Command("frame {frame}"),
    Command("fit decay decay.csv"),
    Command("queue add ./my-decay.yaml --rig ./my-rig.yaml"),
    Command("queue list --queue mine.yaml"),
    Command("queue run --queue mine.yaml --yes"),
    Command("material show blue-paint"),
    Command("material show yellow-textile"),
    Command("fit mixture yellow-textile --threshold 1e-3"),
    Command("schema protocol"),
    Command("optics list"),
    Command("run nothing --rig sim", 2),
    Command("plan ./bad.yaml --rig sim", 2),
    Command("design --no-browser", 143, serves=True),
    Command("render cornell-box --size 32x32 --paths 4 --out box"),
    Command("run led_fluorescence --rig sim-fluorescent --yes"),
    Command("run validate_illuminants --rig sim-fluorescent --yes"),
    Command("run phosphor --rig sim-phosphor --yes"),
)


def prepare(folder: Path) -> None:
    """Write the files of the commands into a folder."""
    (folder / "my-decay.yaml").write_text(PROTOCOL, encoding="utf-8")
    (folder / "bad.yaml").write_text("protocol: decay\nσ: 1\nchrge: 2\n", encoding="utf-8")
    (folder / "mine.yaml").write_text(QUEUE, encoding="utf-8")
    (folder / "decay.csv").write_text(TABLE, encoding="utf-8")
    rig = (resources.folder("config") / "sim.yaml").read_text(encoding="utf-8")
    (folder / "my-rig.yaml").write_text(rig, encoding="utf-8")


def arguments_of(command: Command, folder: Path) -> list[str]:
    frames = sorted((folder / "runs").glob("*/frames/*.*"))
    frame = str(frames[-1].relative_to(folder)) if frames else "none"
    words = [word.replace("{frame}", frame) for word in shlex.split(command.line)]
    return [sys.executable, "-m", "labrig", *words]


def ended(
    command: Command, folder: Path, variables: Mapping[str, str], on_terminal: bool
) -> tuple[int, bytes]:
    """Run a command; return its exit code and all that it printed."""
    environment = {**os.environ, **variables, "COLUMNS": "100", "TERM": "xterm"}
    ours, theirs = pty.openpty() if on_terminal else os.pipe()
    stdin = theirs if on_terminal else subprocess.DEVNULL
    process = subprocess.Popen(
        arguments_of(command, folder),
        cwd=folder, env=environment, stdin=stdin, stdout=theirs, stderr=theirs,
        start_new_session=True,
    )  # fmt: skip
    os.close(theirs)
    printed, begun_s, told = b"", time.monotonic(), False
    while True:
        if select.select([ours], [], [], 0.2)[0]:
            try:
                piece = os.read(ours, 65536)
            except OSError:  # a terminal whose other end is closed
                piece = b""
            if not piece:
                break
            printed += piece
        passed_s = time.monotonic() - begun_s
        is_served = b"http://" in printed or passed_s > SERVES_S
        if (command.serves and is_served and not told) or passed_s > MAX_S:
            process.send_signal(signal.SIGTERM)
            told = True
    os.close(ours)
    return process.wait(), printed


def complaint(command: Command, code: int, printed: bytes, encoding: str) -> str:
    """Return what is wrong with the end of a command; empty if nothing is."""
    if code != command.code:
        return f"exit code {code}: {printed[-300:].decode(encoding, 'backslashreplace')}"
    try:
        text = printed.decode(encoding)
    except UnicodeDecodeError as error:
        return f"not {encoding}: {error}"
    for sign in ("\ufffd", "Traceback", "surrogate", "codec", "Error("):
        if sign in text:
            return f"'{sign}' in: {text[max(text.index(sign) - 80, 0) :][:200]}"
    return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="*", default=[""])
    parser.add_argument("--encodings", nargs="*", default=list(ENCODINGS), choices=ENCODINGS)
    options = parser.parse_args()
    rows = options.rows
    chosen = [COMMANDS[0], *(c for c in COMMANDS[1:] if any(row in c.line for row in rows))]
    wrong = 0
    for name in options.encodings:
        encoding, variables = ENCODINGS[name]
        for on_terminal in (False, True):
            place = "terminal" if on_terminal else "pipe"
            with tempfile.TemporaryDirectory() as made:
                folder = Path(made)
                prepare(folder)
                home = {"HOME": made, "XDG_CONFIG_HOME": made}
                for command in chosen:
                    code, printed = ended(command, folder, {**variables, **home}, on_terminal)
                    problem = complaint(command, code, printed, encoding)
                    wrong += bool(problem)
                    if problem:
                        print(
                            f"WRONG {name}, {place}: labrig {command.line}: {problem}", flush=True
                        )
            print(f"{name}, {place}: {len(chosen)} commands", flush=True)
    print(f"{wrong} of {len(options.encodings) * 2 * len(chosen)} wrong")
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
