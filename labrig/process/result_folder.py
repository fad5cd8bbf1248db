"""The result folder: made beside the old one, which is kept if the new one is any different."""

import shutil
from pathlib import Path

from labrig.process.changes import changes
from labrig.process.provenance import Provenance
from labrig.yaml_file import write_yaml

_EARLIER = "result-"


def new_result(run: Path) -> Path:
    """An empty folder in `run` for `put_in_place`."""
    made = run / "result.part"
    if made.exists():
        shutil.rmtree(made)
    made.mkdir()
    return made


def put_in_place(made: Path) -> tuple[str, ...]:
    """Make the folder `made` the run's `result`; returns what changed, in lines for people.

    The result before it becomes `result-1`, `result-2`, …, from old to new. One that is the same
    to the byte stays where it is, and `made` goes.
    """
    final = made.with_name("result")
    if not final.exists():
        made.rename(final)
        return ()
    told = changes(final, made)
    if not told:
        shutil.rmtree(made)
        return ("the same result as before",)
    numbers = [int(path.name[len(_EARLIER) :]) for path in _earlier(made.parent)]
    earlier = made.with_name(f"{_EARLIER}{max(numbers, default=0) + 1}")
    final.rename(earlier)
    made.rename(final)
    return (f"changed since the result before, which is kept as {earlier.name}:", *told)


def _earlier(run: Path) -> list[Path]:
    return [path for path in run.glob(f"{_EARLIER}*") if path.name[len(_EARLIER) :].isdecimal()]


def write_provenance(made: Path, provenance: Provenance) -> None:
    """Write provenance.yaml into `made`."""
    write_yaml(made / "provenance.yaml", provenance)
