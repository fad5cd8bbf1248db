"""Console blocks of the manual: commands, and the output that the reader is shown."""

import doctest
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

#: `...` stands for anything; columns may be padded.
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
_BLOCK = re.compile(r"^```(console|python)\n(.*?)^```$", re.M | re.S)


@dataclass(frozen=True)
class Command:
    """A command of a console block, or a cell of Python, and the output printed below it."""

    kind: str
    text: str
    shown: str


def commands(page: Path) -> Iterator[Command]:
    """Yield the commands and cells of a page, in order."""
    for kind, block in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "python":
            yield Command(kind, block, "")
            continue
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            typed, _, shown = part.partition("\n")
            yield Command(kind, typed, shown)


def run_commands(page: Path, folder: Path, environment: dict[str, str]) -> None:
    """Run a page's commands in `folder`; what they print has to be what the page shows."""
    namespace: dict[str, object] = {}
    for command in commands(page):
        if command.kind == "python":
            exec(compile(command.text, page.name, "exec"), namespace)
            continue
        ended = subprocess.run(
            command.text, shell=True, cwd=folder, env=environment, text=True, encoding="utf-8",
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, f"{page.name}: {command.text}\n{ended.stdout}"
        if command.shown:
            matches = doctest.OutputChecker().check_output(command.shown, ended.stdout, OPTIONS)
            difference = f"shown:\n{command.shown}\ngot:\n{ended.stdout}"
            assert matches, f"{page.name}: {command.text}\n{difference}"
