"""Longest silence of each command on a terminal, and lines that the terminal breaks.

    python -m tests.acceptance.silences [--columns 80] [--only WORDS ...]

Every command runs under a pseudo-terminal of some columns, in one folder, in which the first ones
make the runs and files that later ones need. Printed are its duration, the longest time without any
output, and the last line on the screen before that. A silence is wrong from 2 s on. Time in which
the command waited for a processor that other programs had does not count. Wrong, too, is a line
that is longer than the terminal is wide, unless a single word of it is: the terminal would break
it within words and numbers. Only JSON and commands to be copied are as long as they are.
"""

import argparse
import os
import re
import select
import shlex
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from math import exp, log
from pathlib import Path

import numpy as np
from rich.cells import cell_len

from labrig.material import ReradiationMatrix, write_reradiation
from tests.material.reradiation.formats.matrices import two_dyes

MAX_SILENCE_S = 2.0
MAX_S = 900.0
#: Rows of tables, matrices of a folder: as many as a patient person may have.
ROWS, MATRICES = 5000, 40

WISH = """\
name: sea
states: 2
albedo: 0.6
scene: {file: cornell-box, material: phosphorescent, white_cd_per_m2: 440}
pixels: {upper: [0.09, 0.35], lower: [0.09, 0.65]}
keys:
  - {at: 1 s, place: upper, colour: "#20c060", brightness: 3.0e-3}
  - {at: 20 s, place: lower, colour: "#20a0a0", brightness: 1.2e-3}
  - {at: 90 s, place: upper, colour: "#2060c0", brightness: 5.0e-4}
"""

COMMANDS = (
    *("--help", "--version", "explain k_e_per_s", "explain iso", "schema rig", "schema protocol"),
    *("protocol list", "protocol new decay", "driver new acme_relay", "rig devices"),
    *("rig new mine.yaml --simulated sim --yes", "rig check sim", "optics list"),
    *("optics show canon_eos_5d_mark_ii", "plan decay --rig sim"),
    *("plan phosphor --rig sim-phosphor", "plan decay --rig sim --predict blue-paint"),
    *("run decay --rig sim", "run decay --rig sim", "process last"),
    *("process last --states 2", "process last --intervals", "process last --law becquerel"),
    *("runs list", "runs show last", "runs compare {first} last", "runs stack last"),
    *("figures last", "note last odd", "verify last", "key new lab", "seal last"),
    *("frame {frame}", "reproduce last", "reproduce last --material blue-paint"),
    *("fit decay table.csv", "fit decay table.csv --intervals", "fit decay many.csv"),
    *("fit charge charge.csv --on 0 --off 120", "fit luminance log.csv"),
    *("material show paper.csv", "material show paper.csv --picture paper.png"),
    *("material list papers", "material list papers --picture papers.png"),
    *("material compare paper.csv fine.csv", "material convert fine.csv fine.yaml"),
    *("material apply paper.csv --light D65 --out seen.csv", "material show blue-paint"),
    *("fit mixture paper.csv", "fit mixture paper.csv --select cross-validation"),
    *("fit mixture fine.csv --out fine", "fit mixture paper.csv --skewed --scale colour"),
    *("leds study paper.csv", "leds study papers --number 9 --out leds"),
    *("render cornell-box", "render colour-chart", "render painted-owl --paths 16"),
    *("design --constraints wish.yaml --out glow.yaml", "queue add decay --rig sim"),
    *("queue list", "queue run"),
    *("run calibration --rig sim-phosphor --yes", "run phosphor --rig sim-phosphor --yes"),
    *("process last", "runs show last", "reproduce last", "figures last"),
    *("reproduce last --rendered --assume-albedo 0.6", "verify last"),
    *("run led_brightness --rig sim-fluorescent --yes",),
    *("run led_fluorescence --rig sim-fluorescent --yes", "process last"),
    *("run validate_illuminants --rig sim-fluorescent --yes", "reproduce last --rendered"),
    *("run luminance --rig sim-luminance --yes", "run camera_curves --rig sim-chart --yes"),
)


def lay_out(folder: Path) -> None:
    """Write the tables, matrices and wishes that the commands read."""
    rng = np.random.default_rng(1)

    def decay(rows: int) -> str:
        times_s = np.linspace(1, 300, rows)
        glow = 100 * np.exp(-times_s / 12) + 40 * np.exp(-times_s / 60)
        glow = glow * (1 + 0.01 * rng.standard_normal(rows))
        return "time,intensity\n" + "".join(
            f"{t:.3f},{y:.4f}\n" for t, y in zip(times_s, glow, strict=True)
        )

    (folder / "table.csv").write_text(decay(60))
    (folder / "many.csv").write_text(decay(ROWS))
    charge = [(t, 50 * (1 - exp(-t / 40))) for t in range(1, 121)]
    charge += [(t, 48 * exp(-(t - 120) / 30)) for t in range(121, 400)]
    (folder / "charge.csv").write_text(
        "time,intensity\n" + "".join(f"{t},{y + 0.1 * (t % 3):.4f}\n" for t, y in charge)
    )
    (folder / "log.csv").write_text(
        "time / min;L / mcd/m2\n"
        + "".join(f"{t};{140 * exp(-1.05 * log(t)):.4f}\n" for t in range(1, 600))
    )
    (folder / "wish.yaml").write_text(WISH)
    (folder / "papers").mkdir()
    for n in range(MATRICES):
        write_reradiation(folder / f"papers/paper-{n}.csv", two_dyes(n, 1e-4))
    write_reradiation(folder / "paper.csv", two_dyes(0, 1e-4))
    write_reradiation(folder / "fine.csv", fine_matrix())


def fine_matrix() -> ReradiationMatrix:
    """Return a matrix in bands of 2 nm, 26 times as large as that of a usual instrument."""
    input_nm, output_nm = np.arange(300.0, 781.0, 2.0), np.arange(380.0, 781.0, 2.0)
    emission = np.exp(-(((output_nm - 530) / 40) ** 2))
    excitation = np.exp(-(((input_nm - 450) / 50) ** 2))
    distance_nm = output_nm[:, np.newaxis] - input_nm
    values = np.where(distance_nm > 0, 0.008 * np.outer(emission, excitation), 0.0)
    values += 1e-5 * np.random.default_rng(1).standard_normal(values.shape)
    values[distance_nm == 0] = 0.5
    return ReradiationMatrix.from_bands("fine paper", input_nm, output_nm, values)


@dataclass(frozen=True)
class Timed:
    """Duration and silences of a command on a terminal."""

    exit_code: int
    wall_s: float
    silence_s: float
    before: str
    too_wide: list[str]


def timed(command: str, folder: Path, columns: int) -> Timed:
    """Run a command under a pseudo-terminal."""
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    began_s = last_s = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "labrig", *shlex.split(command)],
        cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True,
        env={**os.environ, "XDG_CONFIG_HOME": str(folder), "HOME": str(folder)},
    )  # fmt: skip
    os.close(theirs)
    silence_s, before, screen, all_of_it = 0.0, "", "", bytearray()
    waited_s = _waited_s(process.pid)
    while time.monotonic() - began_s < MAX_S:
        ready, _, _ = select.select([ours], [], [], 0.1)
        now_s = time.monotonic()
        silent_s = now_s - last_s - _longest_wait_s(process.pid, waited_s)
        if silent_s > silence_s:
            silence_s, before = silent_s, screen
        if not ready:
            continue
        try:
            printed = os.read(ours, 65536)
        except OSError:
            break
        if not printed:
            break
        all_of_it += printed
        last_s, waited_s = now_s, _waited_s(process.pid)
        screen = _last_line(screen + printed.decode("utf-8", "replace"))
    else:
        process.terminate()
    os.close(ours)
    too_wide = _too_wide(all_of_it.decode("utf-8", "replace"), columns)
    return Timed(process.wait(), time.monotonic() - began_s, silence_s, before, too_wide)


def _waited_s(pid: int) -> dict[str, float]:
    """Return how long each thread could run and did not; none where the system does not say it."""
    waited_s = {}
    for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with suppress(OSError, IndexError):
            waited_s[task.parent.name] = float(task.read_text("utf-8").split()[1]) / 1e9
    return waited_s


def _longest_wait_s(pid: int, before_s: dict[str, float]) -> float:
    """Return how long one of the threads has waited for a processor since `before_s`."""
    now_s = _waited_s(pid)
    return max((now_s[task] - before_s.get(task, 0.0) for task in now_s), default=0.0)


def _too_wide(text: str, columns: int) -> list[str]:
    """Return lines that the terminal breaks though their words would fit."""
    lines = [line.rpartition("\r")[2] for line in _plain(text).replace("\r\n", "\n").split("\n")]
    return [
        line
        for line in lines
        if cell_len(line) > columns
        and max(map(cell_len, line.split())) + 4 <= columns / 2
        and not re.search(r'^ *"|pip install|: labrig ', line)
    ]


def _plain(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


def _last_line(text: str) -> str:
    plain = _plain(text)
    lines = [line.strip() for line in re.split(r"[\r\n]", plain) if line.strip()]
    return lines[-1] if lines else ""


def main() -> None:
    """Print a line for each command; exit code 1 if one is silent for too long."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", help="words of commands; default: all")
    parser.add_argument("--columns", type=int, default=80, help="of the terminal")
    asked = parser.parse_args()
    only = asked.only
    wrong = 0
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        lay_out(folder)
        for command in COMMANDS:
            if only and not any(word in command for word in only):
                continue
            runs = sorted(folder.glob("runs/2*"))
            frames = sorted(folder.glob("runs/*/frames/*"))
            full = command.format(
                first=runs[0].name if runs else "", frame=frames[-1] if frames else ""
            )
            done = timed(full, folder, asked.columns)
            is_wrong = done.silence_s > MAX_SILENCE_S or done.exit_code != 0 or bool(done.too_wide)
            wrong += is_wrong
            print(
                f"{done.wall_s:7.1f} s  silent {done.silence_s:5.2f} s  labrig {command}"
                + (f"\n    exit code {done.exit_code}, after: {done.before}" if is_wrong else "")
                + "".join(f"\n    too wide: {line}" for line in done.too_wide[:5]),
                flush=True,
            )
    print(f"{len(COMMANDS)} commands, {wrong} wrong")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
