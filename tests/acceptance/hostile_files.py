"""Every command that takes a path on files that somebody made to do harm, under watch.

    python -m tests.acceptance.hostile_files [--kinds KIND ...] [--every N]

What the files are and what must hold is in `tests/hostile_files.py`. Every case is a command in a
process of its own, in a copy of the file.
"""

import argparse
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from contextlib import closing, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from labrig.cli.exit_codes import guarded
from tests.acceptance.mutated_files import recorded
from tests.hostile_files import MAKERS, Listener, Outcome, Stage, opened, scenes_of

FILE, OUT, RUN, RIG, PROTOCOL, SCENE, PAPER, TABLE = (
    "FILE", "OUT", "RUN", "RIG", "PROTOCOL", "SCENE", "PAPER", "TABLE",
)  # fmt: skip
#: Every command that takes a path, with the file in the place of each.
COMMANDS = [
    "run FILE --rig RIG --runs OUT --yes --no-process",
    "run PROTOCOL --rig FILE --runs OUT --yes --no-process",
    "run PROTOCOL --rig RIG --runs FILE --yes --no-process",
    "plan FILE --rig RIG", "plan PROTOCOL --rig FILE", "plan PROTOCOL --rig RIG --runs FILE",
    "plan PROTOCOL --rig RIG --predict FILE", "plan PROTOCOL --rig RIG --predict sim --like FILE",
    "resume FILE --yes --no-process", "process FILE", "process FILE --verify",
    "process RUN --camera FILE", "process RUN --optics camera=FILE", "figures FILE",
    "figures RUN --out FILE/figures.pdf", "frame FILE", "compare FILE", "compare FILE --rendered",
    "reproduce RUN --material FILE", "reproduce RUN --camera FILE", "reproduce RUN --out FILE",
    "render FILE --out OUT --paths 1", "render cornell-box --material FILE --out OUT",
    "render SCENE --out FILE --paths 1", "note FILE text", "design FILE --no-browser --port 0",
    "design cornell-box --constraints FILE", "design cornell-box --material FILE --out OUT/d.yaml",
    "design cornell-box --open FILE --no-browser --port 0", "verify FILE",
    "watch FILE --no-browser --port 0", "driver new my_board FILE", "protocol new decay FILE",
    "fit decay FILE", "fit decay FILE --out OUT", "fit decay TABLE --out FILE",
    "fit charge FILE --on 0 --off 10", "fit charge TABLE --on 0 --off 3 --out FILE",
    "fit luminance FILE --off 0", "fit mixture FILE", "fit mixture PAPER --components 1 --out FILE",
    "leds study FILE", "leds study PAPER --leds FILE", "leds study PAPER --camera FILE",
    "material show FILE", "material show PAPER --light FILE", "material convert FILE OUT/x.csv",
    "material from-cubes FILE OUT/x.csv", "material apply FILE --light D65",
    "material apply PAPER --light FILE", "material compare FILE PAPER",
    "material compare PAPER FILE", "material list FILE", "optics show FILE",
    "queue add PROTOCOL --rig FILE --queue OUT/q.yaml", "queue list --queue FILE",
    "queue add PROTOCOL --rig RIG --queue FILE", "queue run --queue FILE --runs OUT --yes",
    "rig check FILE", "rig view FILE --no-browser --port 0", "rig use FILE",
    "runs list --runs FILE", "runs show FILE", "runs compare FILE RUN", "runs trap-depth FILE",
    "sim camera --rig FILE --port 0",
]  # fmt: skip


def commands(file: Path, place: Path, given: dict[str, str]) -> Iterator[list[str]]:
    """Yield the words of every command, and rendering of every scene that names the file."""
    named = given | {FILE: str(file), OUT: str(place / "out")}
    for command in COMMANDS:
        yield [_filled(word, named) for word in command.split()]
    for kind, text in scenes_of(file).items():
        scene = place / f"{kind}.yaml"
        scene.write_text(text)
        yield ["render", str(scene), "--out", str(place / "out"), "--paths", "1"]


def _filled(word: str, named: dict[str, str]) -> str:
    for name, path in named.items():
        if word == name or word.startswith(f"{name}/") or word.endswith(f"={name}"):
            return word.replace(name, path)
    return word


def main() -> None:
    """Print a line for each kind of file, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kinds", nargs="*", default=list(MAKERS))
    parser.add_argument(
        "--every", type=int, default=1, help="each Nth command, other ones for each file"
    )
    asked = parser.parse_args()
    outcomes: dict[str, list[Outcome]] = defaultdict(list)
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as scratch, closing(Listener()) as listener:
        place = Path(scratch)
        run = recorded(place)
        given = _sound(place / "sound", run)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            for line in (f"render {given[SCENE]} --out {place}/warm --paths 1",
                         f"material show {given[PAPER]}", f"fit decay {given[TABLE]}"):  # fmt: skip
                guarded(line.split())  # all is imported and compiled before the first case
        for kind, name, number in _cases(asked.kinds, asked.every):
            case, home = place / "case", place / "case" / "home"
            stage = Stage(case / "theirs", case / "outside", listener.port, run, run / "rig.yaml")
            for folder in (stage.folder, stage.outside, home):
                folder.mkdir(parents=True)
            stage.mine.write_text("mine")
            words = list(commands(MAKERS[kind][name](stage), home, given))[number]
            outcome = opened(words, stage, listener, home)
            outcomes[kind].append(outcome)
            if outcome.wrong:
                told = " ".join(words).replace(str(case), "").replace(str(place), "")
                wrong.append(f"{name}, labrig {told}: {'; '.join(outcome.wrong)}")
                print(wrong[-1], *outcome.lines[:2], sep="\n    ", flush=True)
            shutil.rmtree(case)
    print("kind       files  cases  wrong   longest  most memory  exit codes")
    for kind, of_kind in outcomes.items():
        codes = sorted(Counter(one.code for one in of_kind).items())
        print(
            f"{kind:10}{len(MAKERS[kind]):6}{len(of_kind):7}"
            f"{sum(bool(one.wrong) for one in of_kind):7}"
            f"{max(one.took_s for one in of_kind):8.1f} s"
            f"{max(one.peak_bytes for one in of_kind) / 1e6:10.0f} MB  "
            f"{', '.join(f'{code}: {count}' for code, count in codes)}"
        )
    total = sum(map(len, outcomes.values()))
    print(f"{len(wrong)} of {total} went wrong")
    sys.exit(bool(wrong))


def _cases(kinds: Iterable[str], every: int) -> Iterator[tuple[str, str, int]]:
    """Yield kind and name of a file, and the number of a command, other ones for each file."""
    count = len(COMMANDS) + len(scenes_of(Path()))
    files = [(kind, name) for kind in kinds for name in MAKERS[kind]]
    for first, (of_kind, name) in enumerate(files):
        yield from ((of_kind, name, number) for number in range(first % every, count, every))


def _sound(place: Path, run: Path) -> dict[str, str]:
    """Make sound files of each kind, for the other places of a command."""
    from tests.hostile_files import scene_with

    place.mkdir()
    (place / "scene.yaml").write_text(scene_with())
    rows = "".join(f"{t},{2**-t}\n" for t in range(12))
    (place / "table.csv").write_text(f"t_s,value\n{rows}")
    return {
        RUN: str(run), RIG: str(run / "rig.yaml"), PROTOCOL: str(run / "protocol.yaml"),
        SCENE: str(place / "scene.yaml"), TABLE: str(place / "table.csv"),
        PAPER: "orange-textile",
    }  # fmt: skip


if __name__ == "__main__":
    main()
