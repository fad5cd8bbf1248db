"""Files of a run that were edited since: each key is named, and the journal's is used."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.record import JOURNAL, edited_keys, read_run
from labrig.results import read_result
from tests.conftest import Ended
from tests.resealed import reseal

Labrig = Callable[..., Ended]


def leaves(content: Any, place: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """The places of all values in a file's content."""
    if isinstance(content, dict) and content:
        for key, value in content.items():
            yield from leaves(value, (*place, key))
    else:
        yield place


def edit(path: Path, place: tuple[str, ...], value: Any) -> None:
    """Replace a value in a YAML file; None takes the key away."""
    content = at = read_yaml(path)
    for key in place[:-1]:
        at = at[key]
    del at[place[-1]]
    if value is not None:
        at[place[-1]] = value
    path.write_text(yaml_text(content), encoding="utf-8")


@pytest.mark.parametrize("name", ["protocol.yaml", "rig.yaml"])
def test_every_edited_key_is_named_with_both_values(finished: Path, name: str) -> None:
    path = finished / name
    text = path.read_text(encoding="utf-8")
    places = list(leaves(read_yaml(path)))
    assert len(places) > 8
    for place in places:
        edit(path, place, "edited")
        (line,) = edited_keys(finished)
        assert line.startswith(f"{name} was edited: {'.'.join(place)} is 'edited', in the journal ")
        path.write_text(text, encoding="utf-8")
    edit(path, places[0], None)
    assert f"{'.'.join(places[0])} is not there, in the journal " in edited_keys(finished)[0]
    path.write_text(f"# a comment\n{text}", encoding="utf-8")
    assert edited_keys(finished) == ()


def test_edits_are_named_and_taken_only_when_asked_for(labrig: Labrig, finished: Path) -> None:
    before = (finished / "result" / "result.json").read_bytes()
    edit(finished / "protocol.yaml", ("patches",), {"sample": [0.4, 0.4, 0.1, 0.1]})
    edit(finished / "protocol.yaml", ("sample", "name"), "another")
    for command in (("runs", "show"), ("process",), ("resume",), ("verify",)):
        ended = labrig(*command, finished)
        assert ended.code == (4 if command == ("verify",) else 0)
        for key in ("sample.name is 'another', in the journal 'test'", "patches.sample is"):
            assert key in ended.out + ended.err, command
    assert (finished / "result" / "result.json").read_bytes() == before
    assert json.loads(labrig("runs", "show", finished, "--json").out)["edited"]
    assert labrig("process", finished, "--edited").code == 0
    result = read_result(finished)
    assert "run-edited" in [warning.code for warning in result.warnings]
    provenance = read_yaml(finished / "result" / "provenance.yaml")
    assert provenance["regions"] == {"sample": [0.4, 0.4, 0.1, 0.1]}
    assert provenance["given"] == ["--edited"]


def test_what_resume_takes_is_in_the_journal_from_then_on(labrig: Labrig, finished: Path) -> None:
    journal = finished / JOURNAL
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    starts = [number for number, line in enumerate(lines) if line.startswith('{"name": "start"')]
    lost = {Path(frame.path).name for frame in read_run(finished).attempts[-1].frames}
    journal.write_text("".join(lines[: starts[-1]]), encoding="utf-8")
    for name in lost:
        (finished / "frames" / name).unlink()
    edit(finished / "protocol.yaml", ("sample", "batch"), "B-17")
    assert "sample.batch is 'B-17'" in labrig("runs", "show", finished).out
    assert labrig("resume", finished, "--edited").code == 0
    assert "edited" not in labrig("runs", "show", finished).out
    assert labrig("verify", finished).code == 0
    document = json.loads(journal.read_text(encoding="utf-8").splitlines()[0])
    assert "B-17" not in document["doc"]["files"]["protocol"]


def test_a_journal_without_the_files_leaves_them_as_they_are(
    labrig: Labrig, finished: Path
) -> None:
    journal = finished / JOURNAL
    first, *rest = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    document = json.loads(first)
    del document["doc"]["files"]
    journal.write_text(json.dumps(document) + "\n" + "".join(rest), encoding="utf-8")
    reseal(journal)
    edit(finished / "protocol.yaml", ("sample", "batch"), "B-17")
    assert edited_keys(finished) == ()
    assert labrig("process", finished).code == 0
