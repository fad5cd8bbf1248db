"""Journals that somebody edited: every field of every kind of line, and lines as a whole.

    python -m tests.acceptance.edited_journals [--edits 200] [--seed 1]

A recorded and sealed decay, and a run with a spectrometer, are edited one place at a time. Each
edit is tried in four ways: as it is; with the chain of lines made anew; with that, and without the
seal and the signature; and with that, and without the result. The last forger leaves nothing but
RAW files that disagree; the table says how much they tell.
"""

import argparse
import copy
import json
import random
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from labrig.cli.exit_codes import guarded
from labrig.foundation import resources
from labrig.foundation.errors import LabrigError
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.process import process_run, seal_run, verify_run
from labrig.seal import SEAL, SIGNATURE, LabKey, Signers, create_key
from tests.resealed import reseal

DECAY = {
    "protocol": "decay",
    "sample": {"name": "test"},
    "charge": "5 min",
    "first": "1 s",
    "for": "60 s",
}
READINGS = {"leds": ["455 nm", "530 nm"], "longest": "1 s", "exposures": 2, "repeats": 1}
#: Ways of forging, from the one who edits a line to the one who leaves nothing but RAW files.
WAYS = ("line alone", "chain anew", "seal removed", "result removed")
OUTCOMES = ("refused", "named", "same numbers", "silent")
TIME_S = 1_767_225_600.0


@dataclass(frozen=True)
class Edit:
    """One edit of a journal.

    Attributes
    ----------
    field
        Kind of line and field, as in `frames exposure_s`.
    lines
        Lines of the journal after it.
    """

    field: str
    lines: tuple[str, ...]


def recorded(place: Path, protocol: dict[str, Any], rig: str) -> Path:
    """Return the folder of a short recorded run on a small simulated rig."""
    place.mkdir()
    content = read_yaml(resources.folder("config") / f"{rig}.yaml")
    content["simulation"] |= {"sensor": {"width": 96, "height": 64}}
    (place / "rig.yaml").write_text(yaml_text(content))
    (place / "protocol.yaml").write_text(yaml_text(protocol))
    asked = ["run", str(place / "protocol.yaml"), "--rig", str(place / "rig.yaml"), "--no-process"]
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()) as said:
        code = guarded([*asked, "--yes", "--runs", str(place / "runs")])
    if code:
        sys.exit(f"on a sound run: exit code {code}, {said.getvalue()[-300:]}")
    (run,) = (place / "runs").iterdir()
    return run


def leaves(content: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the paths of all values in a document."""
    if isinstance(content, dict) and content:
        for key, value in content.items():
            yield from leaves(value, (*path, key))
    else:
        yield path


def kind_of(entry: dict[str, Any], streams: dict[str, str]) -> str:
    """Return the kind of a line: that of its document, or the stream of an event."""
    doc = entry["doc"]
    if entry["name"] == "descriptor":
        streams[doc["uid"]] = doc["name"]
        return f"descriptor of {doc['name']}"
    return streams[doc["descriptor"]] if entry["name"] == "event" else str(entry["name"])


def edited_values(value: Any) -> Iterator[Any]:
    """Yield other values than one in a journal."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int | float):
        yield from (value * 1.03, value + 0.7, value - 1, 0)
    elif value == "on" or value == "off":
        yield "off" if value == "on" else "on"
    elif isinstance(value, str):
        yield from (f"{value}x", "")
    yield None


def edits(journal: Path, rng: random.Random, number: int) -> list[Edit]:
    """Return edits of all fields of all kinds of lines, and of lines as a whole."""
    lines = journal.read_text(encoding="utf-8").splitlines()
    entries, streams = [json.loads(line) for line in lines], dict[str, str]()
    places: dict[str, list[tuple[int, tuple[Any, ...]]]] = defaultdict(list)
    by_kind: dict[str, list[int]] = defaultdict(list)
    for n, entry in enumerate(entries):
        kind = kind_of(entry, streams)
        by_kind[kind].append(n)
        for path in leaves(entry["doc"]):
            name = ".".join(str(key) for key in path if key != "data")
            places[f"{kind}: {name}"].append((n, path))
    made = []
    fields = [*places] * (number // len(places) + 1)
    for field in fields[: max(number - 3 * len(by_kind), len(places))]:
        n, path = rng.choice(places[field])
        made.append(_with_value(field, lines, entries[n], n, path, rng))
    for kind, numbers in by_kind.items():
        n, other = rng.choice(numbers), rng.randrange(len(lines))
        for what, kept in (
            ("removed", [*lines[:n], *lines[n + 1 :]]),
            ("doubled", [*lines[:n], lines[n], *lines[n:]]),
            ("moved", _swapped(lines, n, other)),
        ):
            if kept != lines:
                made.append(Edit(f"{kind}: line {what}", tuple(kept)))
    return made


def _with_value(
    field: str,
    lines: Sequence[str],
    entry: dict[str, Any],
    n: int,
    path: tuple[Any, ...],
    rng: random.Random,
) -> Edit:
    changed = copy.deepcopy(entry)
    holder = changed["doc"]
    for key in path[:-1]:
        holder = holder[key]
    others = [value for value in edited_values(holder[path[-1]]) if value != holder[path[-1]]]
    holder[path[-1]] = rng.choice(others)
    return Edit(field, (*lines[:n], json.dumps(changed, ensure_ascii=False), *lines[n + 1 :]))


def _swapped(lines: Sequence[str], one: int, other: int) -> list[str]:
    swapped = list(lines)
    swapped[one], swapped[other] = swapped[other], swapped[one]
    return swapped


def everywhere(journal: Path) -> Iterator[Edit]:
    """Yield edits of one field in all lines: exposures, times of a role, ISO and f-number."""
    lines = journal.read_text(encoding="utf-8").splitlines()
    entries = [json.loads(line) for line in lines]

    def edited(field: str, change: dict[str, Any], role: str = "decay") -> Edit:
        changed = copy.deepcopy(entries)
        for entry in changed:
            data = entry["doc"].get("data", {})
            if data.get("role") == role:
                data |= {key: make(data[key]) for key, make in change.items()}
        return Edit(field, tuple(json.dumps(entry, ensure_ascii=False) for entry in changed))

    longer = {"exposure_s": lambda value: value * 1.03}
    yield edited("all decay frames: exposure × 1.03", longer)
    yield edited(
        "all decay frames: exposure × 1.03 and its end",
        longer | {"end_time": lambda value: value + 0.03 * entries_exposure(entries)},
    )
    later = dict.fromkeys(("start_time", "end_time"), lambda value: value + 0.7)
    yield edited("all decay frames: times + 0.7 s", later)
    yield edited("all decay frames: ISO × 2", {"iso": lambda value: value * 2})
    yield edited("all decay frames: f-number × 1.03", {"f_number": lambda value: value * 1.03})


def entries_exposure(entries: Sequence[dict[str, Any]]) -> float:
    """Return the exposure time of the first decay frame in seconds."""
    data = (entry["doc"].get("data", {}) for entry in entries)
    return float(next(each["exposure_s"] for each in data if each.get("role") == "decay"))


def forge(sound: Path, place: Path, edit: Edit, way: str) -> Path:
    """Return a copy of a run with an edited journal."""
    if place.exists():
        shutil.rmtree(place)
    run = Path(shutil.copytree(sound, place))
    (run / "journal.jsonl").write_text("".join(f"{line}\n" for line in edit.lines), "utf-8")
    if way != "line alone":
        reseal(run / "journal.jsonl")
    if way in ("seal removed", "result removed"):
        (run / SEAL).unlink()
        (run / SIGNATURE).unlink()
    if way == "result removed":
        shutil.rmtree(run / "result", ignore_errors=True)
    return run


def outcome(run: Path, signers: Signers, sound: str | None) -> str:
    """Return what labrig says of an edited run."""
    verification = verify_run(run, signers)
    if not verification.is_intact:
        return "refused"
    if verification.doubtful:
        return "named"
    if sound is None:
        return "silent"
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            result = process_run(run)
    except LabrigError:
        return "refused"
    return "same numbers" if result.to_json() == sound else "silent"


def tried(sound: Path, made: Sequence[Edit], key: LabKey, place: Path, process: bool) -> int:
    """Print a table of all edits of a run, and return how many were silent where none may be."""
    numbers = None
    if process:
        numbers = process_run(sound).to_json()
    seal_run(sound, key, TIME_S)
    signers = Signers({key.public: key.name})
    if verify_run(sound, signers).status != "sealed":
        sys.exit("a sound run is not intact")
    counts: dict[str, dict[str, int]] = {way: dict.fromkeys(OUTCOMES, 0) for way in WAYS}
    untold: dict[str, int] = defaultdict(int)
    for edit in made:
        for way in WAYS:
            if way == "seal removed" and not process:
                continue
            run = forge(sound, place / sound.name, edit, way)
            said = outcome(run, signers, numbers)
            counts[way][said] += 1
            if way == "result removed" and said == "silent":
                untold[edit.field] += 1
    fields = {edit.field for edit in made}
    print(f"{sound.name}: {len(made)} edits of {len(fields)} fields and kinds of lines")
    print(f"{'forged':16}" + "".join(f"{name:>14}" for name in OUTCOMES))
    for way, outcomes in counts.items():
        if any(outcomes.values()):
            print(f"{way:16}" + "".join(f"{outcomes[name]:14}" for name in OUTCOMES))
    print("RAW files alone do not tell: " + ", ".join(sorted(untold)) + "\n", flush=True)
    return sum(counts[way]["silent"] for way in WAYS[:3])


def main() -> None:
    """Print a table for each run; exit with 1 if an edit was silent beside a seal or a result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edits", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        key = create_key(place / "key", "Example lab")
        decay = recorded(place / "decay", DECAY, "sim-phosphor")
        shipped = read_yaml(resources.find("protocols", "protocol", "led_brightness"))
        readings = recorded(place / "readings", shipped | READINGS, "sim-fluorescent")
        silent = 0
        for run, process in ((decay, True), (readings, False)):
            journal = run / "journal.jsonl"
            made = edits(journal, random.Random(asked.seed), asked.edits)
            more = list(everywhere(journal)) if process else []
            silent += tried(run, [*more, *made], key, place / "forged", process)
    print(f"{silent} silent beside a seal or a result")
    sys.exit(bool(silent))


if __name__ == "__main__":
    main()
