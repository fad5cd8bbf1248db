"""Mistakes of a first day with labrig: for each the line that is printed, and the exit code.

    python -m tests.acceptance.first_day [--labrig COMMAND] [--only WORDS ...]

Every mistake is made in a folder of its own by a command in a process of its own. A mistake is
wrong if labrig does not end with one line on standard error that has what the beginner needs, such
as the name that was meant, and with the exit code of its kind (2: asked for something that cannot
be).
Commands that must simply work are among them: what they print is compared alike.
COMMAND is another labrig, such as one of an older clone, for a table of before and after.
"""

import argparse
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.acceptance import first_day_files
from tests.acceptance.mistake import DECAY, SIM_RIG, TWO_COLUMNS, Mistake, protocol_mistake

MAX_S = 60.0

#: Decay whose frames and journal the runs of mistakes have.
RECORDED = Path(__file__).parents[1] / "recordings/decay/run"
DECIMAL_COMMAS = TWO_COLUMNS.replace(",", ";").replace(".", ",")
WITH_ERRORS = "time,intensity,Error\n" + "".join(
    f"{row},0.3\n" for row in TWO_COLUMNS.splitlines()[1:]
)


def rig_mistake(name: str, text: str, needs: str, exit_code: int = 2) -> Mistake:
    """Return the mistake of running a decay on this rig."""
    files = {"rig.yaml": text}
    return Mistake(name, "run decay --rig rig.yaml --yes", needs, exit_code, files)


def table_mistake(name: str, text: str, needs: str, exit_code: int = 0) -> Mistake:
    """Return the mistake of fitting this table, or what one expects to work."""
    return Mistake(name, "fit decay table.csv", needs, exit_code, {"table.csv": text})


MISTAKES = (
    Mistake("a command misspelt", "rnu decay --rig sim", "run"),
    Mistake("no rig given", "run decay", "--rig.*(sim|rig use)"),
    Mistake("a protocol misspelt", "run decya --rig sim", "decay"),
    Mistake("a protocol's file that is not there", "run mine.yaml --rig sim", "mine.yaml"),
    Mistake("a rig misspelt", "plan decay --rig smi", "sim"),
    Mistake("rig and protocol exchanged", "plan sim --rig decay", "rig|protocol"),
    Mistake("an option misspelt", "run decay --rgi sim", "--rig"),
    protocol_mistake("a key misspelt", DECAY + "exposre: 1 s\n", "exposure"),
    protocol_mistake("a tab in YAML", "protocol: decay\nsample:\n\tname: paint\n", "tab|space"),
    protocol_mistake("a time without a unit", DECAY + "every: 5\n", "5 s"),
    protocol_mistake("a negative time", DECAY + "every: -5 s\n", "every"),
    protocol_mistake(
        "exposures longer than their spacing",
        DECAY + "every: 0.5 s\nexposure: 0.5 s\n",
        "every.* s",
    ),
    protocol_mistake(
        "a region outside the frame", DECAY + "patches: {a: [5000, 100, 50, 50]}\n", "1404"
    ),
    protocol_mistake(
        "a region in per cent", DECAY + "patches: {a: [30, 30, 40%, 40]}\n", "fraction"
    ),
    protocol_mistake("a sample that is a list", DECAY.replace("{name: paint}", "[a, b]"), "name"),
    protocol_mistake("a sample without a name", DECAY.replace("{name: paint}", ""), "name"),
    protocol_mistake(
        "an aperture the camera lacks", DECAY + "camera: {f_number: 3.3}\n", "2.8, f/4"
    ),
    protocol_mistake("an ISO the camera lacks", DECAY + "camera: {iso: 450}\n", "400"),
    protocol_mistake("four states", DECAY + "states: 4\n", "1, 2, 3|auto"),
    Mistake(
        "a protocol whose calibration the rig lacks",
        "plan excitation --rig sim",
        "irradiance.*--optics",
        0,
    ),
    Mistake(
        "a shipped protocol on the other shipped rig",
        "plan decay --rig sim-phosphor",
        "lab time",
        0,
    ),
    rig_mistake("a driver misspelt", SIM_RIG.replace("numato", "numato_rely"), "numato"),
    rig_mistake(
        "a serial port that is not there",
        SIM_RIG.replace("sim://room/relays", "/dev/ttyUSB97"),
        "rig devices|ttyUSB97",
        3,
    ),
    rig_mistake(
        "a camera that is not connected",
        SIM_RIG.replace("sim://room/camera", "usb://04a9:3199"),
        "04a9:3199",
        3,
    ),
    rig_mistake(
        "a simulated material misspelt", SIM_RIG.replace("blue-paint", "blue-pant"), "blue-paint"
    ),
    rig_mistake("a relay that the board lacks", SIM_RIG.replace("relay: 0", "relay: 99"), "relay"),
    rig_mistake("no lamp", re.sub(r"  lamp.*\n", "", SIM_RIG), "lamp"),
    Mistake("runs listed where there are none", "runs list", "runs"),
    Mistake("processing what is not there", "process blue", "runs"),
    Mistake("processing the wrong folder", "process .", "journal|run folder"),
    Mistake(
        "a run folder that is a file", "run decay --rig sim --runs taken", "taken", 5, {"taken": ""}
    ),
    Mistake("watching nothing", "watch last", "runs"),
    table_mistake("a table with two columns", TWO_COLUMNS, "0.0[45]"),
    table_mistake("a table with a column Error", WITH_ERRORS, "0.0[45]"),
    table_mistake("a table with decimal commas", DECIMAL_COMMAS, "0.0[45]"),
    table_mistake("a table of one column", "intensity\n3\n2\n1\n", "time", 2),
    table_mistake("a table of words", "Dear diary,\ntoday I measured.\n", "column|number", 2),
    table_mistake("a table with a gap", re.sub("(?m)^6,.*$", "6,", TWO_COLUMNS), "line [0-9]", 2),
    Mistake("a table that is not there", "fit decay table.csv", "table.csv"),
    *first_day_files.MISTAKES,
)


@dataclass(frozen=True)
class Answer:
    """Last line that labrig printed, its exit code, and the time that it took."""

    line: str
    exit_code: int
    duration_s: float
    error_lines: int

    def fault(self, mistake: Mistake) -> str:
        """Return what is wrong with it, empty if nothing is."""
        if self.exit_code != mistake.exit_code:
            return f"exit code {self.exit_code} instead of {mistake.exit_code}"
        if mistake.exit_code and self.error_lines != 1:
            return f"{self.error_lines} lines instead of 1"
        if not re.search(mistake.needs, self.line):
            return f"no {mistake.needs!r} in it"
        return ""


def lay_out(mistake: Mistake, folder: Path, run: Path) -> None:
    """Write the files of a mistake into an empty folder; `run` is a processed run."""
    for name, text in mistake.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    if mistake.has_run:
        shutil.copytree(run, folder / "runs/mine")
        shutil.copy(sorted((run / "frames").iterdir())[-1], folder / "frame.dng")


def answer(labrig: str, mistake: Mistake, run: Path) -> Answer:
    """Make a mistake in a folder of its own."""
    folder = Path(tempfile.mkdtemp())
    try:
        lay_out(mistake, folder, run)
        start_s = time.perf_counter()
        try:
            done = subprocess.run(
                [labrig, *mistake.command.split()],
                cwd=folder,
                capture_output=True,
                text=True,
                stdin=subprocess.DEVNULL,
                timeout=MAX_S,
            )
        except subprocess.TimeoutExpired:
            return Answer(f"nothing within {MAX_S:.0f} s", -1, MAX_S, 0)
        duration_s = time.perf_counter() - start_s
    finally:
        shutil.rmtree(folder)
    errors = [line for line in done.stderr.splitlines() if line.startswith("labrig: ")]
    unexpected = [line for line in done.stderr.splitlines() if "Traceback" in line]
    printed = " ".join(f"{done.stderr} {done.stdout}".split())
    line = errors[-1] if done.returncode and errors else printed
    return Answer(line, done.returncode, duration_s, len(errors) + len(unexpected))


def main() -> None:
    """Print a line for each mistake; exit code 1 if an answer is of no help."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--labrig", default=f"{sysconfig.get_path('scripts')}/labrig")
    parser.add_argument("--only", nargs="*", default=[""], help="words of mistakes; default: all")
    asked = parser.parse_args()
    made = [each for each in MISTAKES if any(word in each.name for word in asked.only)]
    faults = 0
    with tempfile.TemporaryDirectory() as scratch:
        run = Path(scratch, "mine")
        shutil.copytree(RECORDED, run)
        subprocess.run([asked.labrig, "process", str(run)], capture_output=True, check=True)
        for number, mistake in enumerate(made, 1):
            given = answer(asked.labrig, mistake, run)
            fault = given.fault(mistake)
            faults += bool(fault)
            print(f"{number:2} {mistake.name}: labrig {mistake.command}")
            print(f"   {given.exit_code}, {given.duration_s:.1f} s: {given.line[:300]}")
            if fault:
                print(f"   WRONG: {fault}", flush=True)
    print(f"{len(made)} mistakes, {faults} answered wrongly")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
