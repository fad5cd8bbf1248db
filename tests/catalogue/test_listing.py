"""The list of runs: true of every protocol and at every moment, with an index or without."""

import hmac
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from zlib import crc32

import pytest
from filelock import FileLock

from labrig.acquire import ProtocolModel, read_protocol
from labrig.catalogue import RunFilter, RunSummary, find_run, list_runs, summarise
from labrig.foundation import resources
from labrig.foundation.yaml_file import yaml_text
from labrig.record import RunFolder, add_note, own_digest
from labrig.results import write_fitted_decay, write_summary
from tests.conftest import Ended
from tests.results.made import decay_result

Labrig = Callable[..., Ended]

#: One by itself and a chain of parts; all others are listed by the same code.
LISTED = [
    name if name in ("decay", "phosphor") else pytest.param(name, marks=pytest.mark.campaign)
    for name in sorted(resources.names("protocols"))
]
#: Virtual time at which every run of these tests begins, as in a simulated room.
EPOCH_S = 1_767_225_600.0
INDEX = ".runs-index"


def record_run(runs: Path, protocol: ProtocolModel, endings: Sequence[str] = ()) -> Path:
    """Record units without frames, each with the status by which its attempt ends."""
    text = yaml_text(protocol.model_dump(mode="json", by_alias=True))
    name = f"{protocol.protocol}_{protocol.sample.name}"
    with RunFolder.create(runs, name, EPOCH_S, {"protocol.yaml": text}, 1) as folder:
        for unit, ending in zip(protocol.units(), endings, strict=False):
            attempt = folder.attempt(unit.name, lambda: EPOCH_S, {})
            if ending:
                attempt.stop(ending, "the lamp is lost")
    return folder.path


def settle(runs: Path) -> None:
    """Make all files look an hour old, so that an index keeps what it knows of them."""
    for path in [*runs.rglob("*"), runs]:
        status = path.stat()
        an_hour_ns = 3600 * 10**9
        os.utime(path, ns=(status.st_atime_ns - an_hour_ns, status.st_mtime_ns - an_hour_ns))


def as_other_code_wrote_it(run: Path) -> None:
    """Replace the index by one whose summaries lack what they have now, by an older code."""
    index = run.parent / INDEX
    entries = json.loads(index.read_bytes().split(b"\n", 1)[1])
    for entry in entries.values():
        entry["content"]["of_another_code"] = entry["content"].pop("status")
    content = json.dumps(entries).encode()
    other_code = b"%08x" % crc32(version("labrig").encode())
    index.write_bytes(own_digest(other_code + content).encode() + b"\n" + content)


def as_somebody_else_wrote_it(run: Path) -> None:
    """Replace the index by one with other numbers, which holds whatever files the runs have."""
    index = run.parent / INDEX
    entries = json.loads(index.read_bytes().split(b"\n", 1)[1])
    for entry in entries.values():
        entry["stamps"] = {}
        entry["content"]["frames"] = 4711
    content = json.dumps(entries).encode()
    theirs = hmac.new(b"secret of somebody else", content, "sha256").hexdigest()
    index.write_bytes(theirs.encode() + b"\n" + content)


def statuses(runs: Path) -> list[str]:
    return [run.status for run in list_runs(runs, RunFilter())]


def decay() -> ProtocolModel:
    return read_protocol(resources.find("protocols", "protocol", "decay"))


@pytest.mark.parametrize("name", LISTED)
def test_every_protocol_is_listed_as_it_is(tmp_path: Path, labrig: Labrig, name: str) -> None:
    protocol = read_protocol(resources.find("protocols", "protocol", name))
    units = len(protocol.units())
    all_done = ["success"] * units
    begun = record_run(tmp_path, protocol, [*all_done[1:], ""])
    stopped = record_run(tmp_path, protocol, [*all_done[1:], "abort"])
    broken = record_run(tmp_path, protocol, [*all_done[1:], "fail"])
    complete = record_run(tmp_path, protocol, all_done)
    processed = record_run(tmp_path, protocol, all_done)
    (processed / "result").mkdir()
    made = [begun, stopped, broken, complete, processed]
    expected = ["interrupted", "interrupted", "failed", "recorded", "processed"]
    listed = json.loads(labrig("runs", "list", "--json", "--runs", tmp_path).out)
    assert [run["folder"] for run in listed] == [str(path) for path in made]
    assert [run["status"] for run in listed] == expected
    assert {run["sample"] for run in listed} == {protocol.sample.name}
    assert {run["units"] for run in listed} == {units}
    assert [run["done"] for run in listed] == [units - 1] * 3 + [units] * 2
    with FileLock(begun / ".lock"):
        assert statuses(tmp_path) == ["running", *expected[1:]]
    assert statuses(tmp_path) == expected


def test_a_name_from_the_list_is_the_name_of_the_run(tmp_path: Path, labrig: Labrig) -> None:
    made = [record_run(tmp_path / "runs", decay(), ["success"]) for _ in range(11)]
    lines = labrig("runs", "list", "--runs", tmp_path / "runs").out.splitlines()[1:]
    names = [line.split()[0] for line in lines]
    assert names == [path.name for path in made]  # in order of making: -2, …, -10, -11
    for name, path in zip(names, made, strict=True):
        shown = labrig("runs", "show", name, "--runs", tmp_path / "runs")
        assert shown.out.splitlines()[0] == str(path)


def test_what_is_no_decay_is_listed_with_what_it_says_first(tmp_path: Path, labrig: Labrig) -> None:
    protocol = read_protocol(resources.find("protocols", "protocol", "luminance"))
    run = record_run(tmp_path, protocol, ["success"] * len(protocol.units()))
    (run / "result").mkdir()
    write_summary(
        run / "result", ["marking   14.2/0.56-82-K-W\nluminance  after lamp off", "2 min"]
    )
    assert labrig("runs", "--runs", tmp_path).out.splitlines()[1].endswith("14.2/0.56-82-K-W")
    (listed,) = json.loads(labrig("runs", "list", "--runs", tmp_path, "--json").out)
    assert listed["headline"] == "marking   14.2/0.56-82-K-W"
    shown = labrig("runs", "show", run).out.splitlines()
    begin = shown.index("  result:")
    assert [line.split()[0] for line in shown[begin + 1 : begin + 4]] == [
        "marking",
        "luminance",
        "2",
    ]


def test_last_is_the_run_that_was_made_last_whatever_it_is_called(tmp_path: Path) -> None:
    first, second = record_run(tmp_path, decay()), record_run(tmp_path, decay())
    first = first.rename(tmp_path / "zinc-sulphide")
    add_note(first, "a later change", EPOCH_S)
    assert find_run(Path("last"), tmp_path) == second
    copied = tmp_path / "copied"
    shutil.copytree(first, copied, copy_function=shutil.copyfile)
    shutil.rmtree(first)
    assert find_run(Path("last"), tmp_path) == second
    assert [run.folder for run in list_runs(tmp_path, RunFilter())] == [copied, second]


def add_fit(run: Path, rate_per_s: float) -> None:
    (run / "result.part").mkdir()
    write_summary(run / "result.part", [f"k_r {rate_per_s}"])
    write_fitted_decay(run / "result.part" / "fit.json", decay_result((rate_per_s, 1.0)))
    if (run / "result").exists():
        (run / "result").rename(run / "result-1")
    (run / "result.part").rename(run / "result")


def finish(run: Path) -> None:
    protocol = read_protocol(run / "protocol.yaml")
    with RunFolder(run, 1) as folder:
        for unit in protocol.units():
            folder.attempt(unit.name, lambda: EPOCH_S, {}).stop("success")


def rename_sample(run: Path) -> None:
    text = (run / "protocol.yaml").read_text()
    (run / "protocol.yaml").write_text(text.replace("blue-paint", "teal-paint"))


def hide_journal(run: Path) -> None:
    """Make it unreadable, as that of another user is; root may read everything but a folder."""
    (run / "journal.jsonl").unlink()
    (run / "journal.jsonl").mkdir()


@pytest.mark.parametrize(
    "change",
    [
        finish,
        lambda run: add_fit(run, 0.1),
        lambda run: shutil.rmtree(run / "result"),
        lambda run: (run / "result" / "fit.json").unlink(),
        lambda run: (run / "result" / "fit.json").write_text("{}"),
        lambda run: (run / "journal.jsonl").write_text("{]\n{}\n"),
        lambda run: (run / "journal.jsonl").unlink(),
        hide_journal,
        lambda run: write_summary(run / "result", ["another result"]),
        lambda run: (run / "made.txt").write_text("2001-01-01T00:00:00+00:00\n"),
        rename_sample,
        lambda run: shutil.rmtree(run),
        lambda run: run.rename(run.with_name("renamed")),
        lambda run: (run.parent / INDEX).write_bytes(b"\0" * 100),
        lambda run: (run.parent / INDEX).write_bytes((run.parent / INDEX).read_bytes()[:-9]),
        lambda run: (run.parent / INDEX).unlink(),
        as_other_code_wrote_it,
        as_somebody_else_wrote_it,
    ],
)
def test_the_index_never_lies(tmp_path: Path, change: Callable[[Path], object]) -> None:
    all_done = ["success"] * len(decay().units())
    for endings in ([], ["success", "fail"], all_done, all_done[1:]):
        add_fit(record_run(tmp_path, decay(), endings), 0.05)
    settle(tmp_path)
    read = list_runs(tmp_path, RunFilter())
    assert (tmp_path / INDEX).is_file()
    assert list_runs(tmp_path, RunFilter()) == read == in_order(summaries(tmp_path))
    change(read[-1].folder)
    for _ in range(2):
        assert list_runs(tmp_path, RunFilter()) == in_order(summaries(tmp_path))


def summaries(runs: Path) -> list[RunSummary]:
    return [summarise(path.parent) for path in runs.glob("*/protocol.yaml")]


def in_order(runs: list[RunSummary]) -> list[RunSummary]:
    return sorted(runs, key=lambda run: (run.made, run.folder.name))


def test_what_was_just_written_is_read_again(tmp_path: Path) -> None:
    """Some file systems count in seconds: a change within one does not show in a file's time."""
    run = record_run(tmp_path, decay())
    add_fit(run, 0.05)
    fit = run / "result" / "fit.json"
    list_runs(tmp_path, RunFilter())
    status = fit.stat()
    fit.write_text(fit.read_text().replace("0.05", "0.06"))
    os.utime(fit, ns=(status.st_atime_ns, status.st_mtime_ns))
    (again,) = list_runs(tmp_path, RunFilter())
    assert [rate.value for rate in again.parameters[""].values()] == [0.06]


def test_a_folder_that_cannot_be_written_is_listed_as_well(tmp_path: Path) -> None:
    record_run(tmp_path, decay())
    settle(tmp_path)
    (tmp_path / INDEX).mkdir()  # a file cannot take its place, not even for the superuser
    assert statuses(tmp_path) == statuses(tmp_path) == ["interrupted"]
    assert sorted(path.name for path in tmp_path.glob(f"{INDEX}*")) == [INDEX]


def test_lists_made_at_the_same_time_agree(tmp_path: Path) -> None:
    for _ in range(5):
        add_fit(record_run(tmp_path, decay(), ["success"]), 0.05)
    settle(tmp_path)
    command = [sys.executable, "-m", "labrig", "runs", "list", "--json", "--runs", str(tmp_path)]
    together = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    listed = {process.communicate()[0] for process in together}
    assert len(listed) == 1
    assert len(json.loads(listed.pop())) == 5
    assert [path.name for path in tmp_path.glob(f"{INDEX}*")] == [INDEX]
    assert list_runs(tmp_path, RunFilter()) == in_order(summaries(tmp_path))


def test_the_private_run_of_another_user_hides_no_other_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    protocol = read_protocol(resources.find("protocols", "protocol", "decay"))
    private, open_to_all = (record_run(tmp_path, protocol) for _ in range(2))
    is_file = Path.is_file

    def refused(path: Path) -> bool:  # root, who may run the tests, is refused nothing
        if path.parent == private:
            raise PermissionError
        return is_file(path)

    monkeypatch.setattr(Path, "is_file", refused)
    assert [run.folder for run in list_runs(tmp_path, RunFilter())] == [open_to_all]
    assert find_run(Path("last"), tmp_path) == open_to_all
