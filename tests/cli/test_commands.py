"""The commands as a person uses them: results, exit codes, one line when something is wrong."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from hashlib import sha256
from importlib.metadata import EntryPoint
from pathlib import Path
from socket import gethostname
from typing import Any

import numpy as np
import pytest

from labrig.foundation import plugins
from labrig.foundation.yaml_file import read_yaml
from labrig.protocols.decay.result import DecayResult
from labrig.record import RunLock, own_digest, read_run
from labrig.results import read_result
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]
Make = Callable[..., Path]


def one_line(ended: Ended, code: int, *said: str) -> None:
    lines = [line for line in ended.err.splitlines() if not line.startswith("[")]
    assert ended.code == code, ended.err
    assert len(lines) == 1, ended.err
    assert lines[0].startswith("labrig: ")
    for text in said:
        assert text in lines[0]


@pytest.mark.parametrize("command", ["run", "plan"])
@pytest.mark.parametrize(
    ("protocol", "rig", "said"),
    [
        ("decya", "sim", "did you mean 'decay'?"),
        ("decay", "sin", "did you mean 'sim'?"),
        ("none.yaml", "sim", "none.yaml: no such protocol file"),
        ("decay", "none/rig.yaml", "no such rig file"),
    ],
)
def test_unknown_protocols_and_rigs(
    labrig: Labrig, tmp_path: Path, command: str, protocol: str, rig: str, said: str
) -> None:
    one_line(labrig(command, protocol, "--rig", rig, "--runs", tmp_path), 2, said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rig: rig.pop("name"), "'name' is missing"),
        (lambda rig: rig.update(nmae="x"), "did you mean 'name'?"),
        (lambda rig: rig["devices"].update(lmap=rig["devices"].pop("lamp")), "did you mean 'lamp'"),
        (lambda rig: rig["devices"].pop("lamp"), "needs a lamp"),
        (lambda rig: rig["devices"].pop("camera"), "needs a camera"),
        (lambda rig: rig["devices"]["lamp"].update(driver="numatto"), "did you mean 'numato'"),
        (lambda rig: rig["devices"]["lamp"].update(relya=1), "did you mean 'relay'"),
        (lambda rig: rig["devices"]["lamp"].update(relay=99), "relay"),
        (lambda rig: rig["devices"]["lamp"].update(warm_up=15), "unit"),
        (lambda rig: rig["devices"]["camera"].update(frame_size="1 TB"), "frame_size"),
        (lambda rig: rig["devices"]["camera"].update(frame_size="90000 GB"), "free"),
        (lambda rig: rig["optics"].update(camera="canon"), "canon"),
    ],
)
def test_a_plan_is_refused_before_anything_moves(
    labrig: Labrig,
    make_rig: Make,
    tmp_path: Path,
    change: Callable[[dict[str, Any]], None],
    said: str,
) -> None:
    path = make_rig()
    rig = read_quickly(path.read_text())
    change(rig)
    path.write_text(write_quickly(rig))
    for command in ("plan", "run"):
        ended = labrig(command, "decay", "--rig", path, "--runs", tmp_path / "runs")
        one_line(ended, 5 if said == "free" else 2, said)
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("change", "code", "said"),
    [
        ({"sample": "blu-paint"}, 2, "did you mean 'blue-paint'?"),
        ({"sensr": {}}, 2, "did you mean 'sensor'?"),
        ({"faults": ["lamp_daed"]}, 2, "did you mean 'lamp_dead'?"),
    ],
)
def test_a_room_that_cannot_be_built_is_refused(
    labrig: Labrig, make_rig: Make, tmp_path: Path, change: dict[str, object], code: int, said: str
) -> None:
    one_line(
        labrig("run", "decay", "--rig", make_rig(**change), "--runs", tmp_path / "runs"), code, said
    )


def test_a_duplicate_key_is_named_with_its_line(labrig: Labrig, tmp_path: Path) -> None:
    path = tmp_path / "twice.yaml"
    path.write_text("protocol: decay\nevery: 5 s\nevery: 6 s\n")
    one_line(labrig("plan", path, "--rig", "sim"), 2, "line 3", "'every' stands twice")


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (["frobnicate"], "labrig"),
        (["run"], "labrig run"),
        (["plan", "decay", "--rgi", "sim"], "labrig plan"),
        (["rig", "use", "--bad"], "labrig rig use"),
    ],
)
def test_wrong_usage(labrig: Labrig, arguments: list[str], command: str) -> None:
    one_line(labrig(*arguments), 2, f"(see {command} --help)")


@pytest.mark.parametrize(
    ("value", "expected"),
    [("x", "expected a whole number, got 'x'"), ("9", "expected a number of at most 3, got '9'")],
)
def test_an_option_of_another_kind_is_told_plainly(
    labrig: Labrig, finished: Path, value: str, expected: str
) -> None:
    one_line(labrig("process", finished, "--states", value), 2, "--states", expected)


def test_what_is_named_in_an_error_cannot_move_the_cursor(labrig: Labrig) -> None:
    ended = labrig("runs", "show", "\x1b[2J\x07runs")
    assert ended.code == 2
    assert r"\x1b[2J\x07runs" in ended.err
    assert ended.err.rstrip("\n").isprintable()


@pytest.mark.parametrize("command", [["resume"], ["process"]])
def test_what_is_no_run_folder(labrig: Labrig, tmp_path: Path, command: list[str]) -> None:
    one_line(labrig(*command, tmp_path), 2, "expected a run folder")
    one_line(labrig(*command, tmp_path / "nowhere"), 2, "expected a run folder")


def test_a_device_that_is_not_there_is_exit_code_3(
    labrig: Labrig, make_rig: Make, tmp_path: Path
) -> None:
    path = make_rig()
    rig = read_quickly(path.read_text())
    rig["devices"]["lamp"]["address"] = str(tmp_path / "ttyACM7")
    path.write_text(write_quickly(rig))
    one_line(
        labrig("run", "decay", "--rig", path, "--runs", tmp_path / "runs"), 3, "ttyACM7", "nothing"
    )
    assert list((tmp_path / "runs").iterdir()) == []


def test_a_run_ends_in_a_result_that_agrees_with_itself(labrig: Labrig, finished: Path) -> None:
    result = finished / "result"
    fit = json.loads((result / "fit.json").read_text())
    (state,) = fit["states"]
    assert abs(state["k_r_per_s"] - 0.032) < 3 * state["k_r_per_s_sigma"]
    material = read_quickly((result / "material.yaml").read_text())
    assert material["states"][0]["k_r_per_s"] == state["k_r_per_s"]
    assert material["states"][0]["r0"] is None, "a decay alone does not tell r(0)"
    again = labrig("fit", "decay", result / "series.csv", "--json")
    refit = json.loads(again.out)
    assert refit["states"][0]["k_r_per_s"] == pytest.approx(state["k_r_per_s"], rel=1e-3)


@pytest.mark.drawn
def test_figures_are_drawn_into_a_pdf_on_demand(labrig: Labrig, finished: Path) -> None:
    svg_files = list((finished / "result" / "figures").glob("*.svg"))
    pdf = finished / "result" / "figures" / "figures.pdf"
    assert not pdf.exists()
    ended = labrig("figures", finished)
    assert ended.code == 0, ended.err
    assert pdf.read_bytes().count(b"/Type /Page ") == len(svg_files) >= 4
    elsewhere = finished / "paper" / "a.pdf"
    assert labrig("figures", finished, "--out", elsewhere).code == 0
    assert elsewhere.read_bytes() == pdf.read_bytes()
    one_line(labrig("figures", finished / "frames"), 2, "run")
    one_line(labrig("figures", finished, "--out", finished / "journal.jsonl" / "a.pdf"), 5, "jsonl")
    shutil.rmtree(finished / "result")
    one_line(labrig("figures", finished), 2, "expected a run with a result")


def test_a_complete_run_is_not_resumed_but_processed_if_it_was_not(
    labrig: Labrig, finished: Path
) -> None:
    result = finished / "result" / "result.json"
    changed_ns = result.stat().st_mtime_ns
    ended = labrig("resume", finished)
    assert (ended.code, ended.run_folder) == (0, finished)
    (line,) = ended.err.splitlines()
    assert line.startswith("nothing to resume: all units are complete")
    assert result.stat().st_mtime_ns == changed_ns
    shutil.rmtree(finished / "result")
    ended = labrig("resume", finished)
    assert ended.code == 0
    assert "warning" not in ended.err
    assert result.is_file()


def test_processing_otherwise(labrig: Labrig, finished: Path) -> None:
    ended = labrig(
        "process", finished, "--roi", "36,24,24,16", "--exclude", "3", "--states", "2", "--json"
    )
    assert ended.code == 0, ended.err
    excluded = [
        line
        for line in (finished / "result" / "series.csv").read_text().splitlines()
        if "excluded" in line
    ]
    assert excluded == [], "frame 3 is a dark frame, not part of the series"
    asked = labrig("process", finished, "--states", "3")
    codes = ("[rates-indistinct]", "[states-unsupported]")
    warned = [line for line in asked.err.splitlines() if line.endswith(codes)]
    assert warned, asked.err
    for line in warned:
        assert line.removeprefix("warning: ").partition(" [")[0] not in asked.out, "once is enough"
    assert "flicker  " in asked.out
    frame = read_run(finished).frames("decay")[2].path.name
    assert labrig("process", finished, "--exclude", frame).code == 0
    assert f"{frame},decay-1,sample,excluded" in (finished / "result" / "series.csv").read_text()
    one_line(labrig("process", finished, "--exclude", "999"), 2, "no frame 999")
    scaled = labrig("process", finished, "--camera", "nikon_d5100")
    assert "every channel scaled to 1" in scaled.err
    rig = finished / "rig.yaml"
    rig.write_text(rig.read_text().replace("camera: canon_eos_5d_mark_ii", "camera: null"))
    assert labrig("process", finished, "--edited").code == 0
    made = read_quickly((finished / "result" / "provenance.yaml").read_text())
    assert made["camera"] == "Canon EOS 5D Mark II", "by the name that it told"
    rig.write_text(rig.read_text().replace("camera: null", "camera: canon_eos_5d_mark_ii"))
    one_line(labrig("process", finished, "--roi", "nose=1,2,3,4"), 2, "no patch is called 'nose'")
    one_line(labrig("process", finished, "--roi", "90,60,40,40"), 2, "leaves the frame")


def test_a_frame_changed_on_disk_is_noticed(labrig: Labrig, finished: Path) -> None:
    frame = read_run(finished).frames("decay")[1].path
    frame.write_bytes(frame.read_bytes()[:-1] + b"\x00")
    one_line(labrig("process", finished), 4, frame.name, "checksum")
    frame.unlink()
    one_line(labrig("process", finished), 4, frame.name, "missing")
    assert labrig("process", finished, "--exclude", frame.name).code == 0


def test_verify_reads_what_looks_untouched(labrig: Labrig, finished: Path) -> None:
    frame = read_run(finished).frames("decay")[1].path
    status, content = frame.stat(), frame.read_bytes()
    frame.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    os.utime(frame, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert labrig("process", finished).code == 0
    one_line(labrig("process", finished, "--verify"), 4, frame.name, "checksum")
    frame.write_bytes(content)
    ended = labrig("process", finished, "--verify")
    assert ended.code == 0
    assert "checksums" in ended.err


def digest_of_anybody(content: bytes) -> str:
    return sha256(content).hexdigest()


@pytest.mark.parametrize("digest", [own_digest, digest_of_anybody])
def test_reductions_are_trusted_by_who_made_them_alone_and_verify_trusts_none(
    labrig: Labrig, finished: Path, digest: Callable[[bytes], str]
) -> None:
    def rate_per_s() -> float:
        result = read_result(finished)
        assert isinstance(result, DecayResult)
        fit = result.patches["sample"].fit
        assert fit is not None
        return fit.rates[0].value

    sound_per_s = rate_per_s()
    for path in (finished / "cache").glob("*.jsonl"):
        head, _, content = path.read_text().partition("\n")
        keys, texts = zip(*(line.split(" ", 1) for line in content.splitlines()), strict=True)
        # Each frame has another one's values, under a digest of what is there.
        pairs = zip(keys, (*texts[1:], texts[0]), strict=True)
        forged = "".join(f"{key} {text}\n" for key, text in pairs)
        path.write_text(f"{head.rpartition(' ')[0]} {digest(forged.encode())}\n{forged}")
    assert labrig("process", finished).code == 0
    assert (rate_per_s() != sound_per_s) == (digest is own_digest)
    assert labrig("process", finished, "--verify").code == 0
    assert rate_per_s() == sound_per_s


def test_a_second_process_of_a_run_is_told_who_has_it(labrig: Labrig, finished: Path) -> None:
    with RunLock(finished / ".process.lock", "processing this run"):
        one_line(labrig("process", finished), 2, str(os.getpid()), gethostname(), "UTC")
    assert labrig("process", finished).code == 0


def test_a_series_without_light_is_kept_and_reported(labrig: Labrig, finished: Path) -> None:
    ended = labrig("process", finished, "--roi", "1,1,80,4")  # the cloth beside the sample
    one_line(ended, 4, "was the sample charged", "the run is kept")
    assert (finished / "result" / "report.html").exists()


def test_frame_prints_what_is_in_a_raw_file(labrig: Labrig, finished: Path) -> None:
    path = read_run(finished).frames("decay")[0].path
    ended = labrig("frame", path, "--roi", "32,20,30,24", "--json")
    measured = json.loads(ended.out)
    assert set(measured) == {
        "channels", "black", "white", "cfa", "width", "height", "exposure_s", "iso", "f_number",
        "make", "model",
    }  # fmt: skip
    assert (measured["width"], measured["height"], measured["cfa"]) == (96, 64, "RGGB")
    assert measured["channels"]["G"]["mean"] > 100
    assert "G" in labrig("frame", path).out
    one_line(labrig("frame", path, "--roi", "1,2,3"), 2, "x,y,width,height")


def test_what_cannot_be_reduced_is_exit_code_4(labrig: Labrig, tmp_path: Path) -> None:
    (tmp_path / "photo.cr2").write_bytes(b"no photo at all")
    one_line(labrig("frame", tmp_path / "photo.cr2"), 4, "photo.cr2")
    one_line(labrig("frame", tmp_path / "none.cr2"), 2, "none.cr2")
    (tmp_path / "series.csv").write_text("t_s,G\n0,1\n1,what\n2,3\n")
    one_line(labrig("fit", "decay", tmp_path / "series.csv"), 2, "series.csv", "delete the row")
    (tmp_path / "short.csv").write_text("t_s,G\n0,1\n")
    one_line(labrig("fit", "decay", tmp_path / "short.csv"), 4)


def test_a_protocol_of_a_package_is_listed_and_needs_a_file_of_ones_own(
    labrig: Labrig, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry = plugins._registry()
    decay = registry[plugins.MEASUREMENTS]["decay"]
    other = EntryPoint("lamp_drift", decay.value, decay.group)
    registered = {**registry[plugins.MEASUREMENTS], "lamp_drift": other}
    extended = {**registry, plugins.MEASUREMENTS: registered}
    monkeypatch.setattr(plugins, "_registry", lambda: extended)
    assert "lamp_drift" in labrig("protocol", "list").out
    one_line(labrig("plan", "lamp_drift", "--rig", "sim"), 2, "installed", "lamp_drift.yaml")


def test_what_there_is_is_listed(labrig: Labrig) -> None:
    assert "decay" in labrig("protocol", "list").out


@pytest.mark.parametrize(
    ("arguments", "slow"),
    [
        pytest.param(
            "--help",
            ("numpy", "scipy", "pydantic", "event_model", "rawpy"),
            marks=pytest.mark.campaign,
        ),
        ("runs list --runs .", ("numpy", "scipy", "yaml", "event_model", "rawpy")),
        ("plan decay --rig sim", ("scipy", "event_model", "rawpy", "matplotlib")),
    ],
)
def test_commands_load_what_they_use_only(
    tmp_path: Path, arguments: str, slow: tuple[str, ...]
) -> None:
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "labrig", *arguments.split()],
        capture_output=True, text=True, check=True, cwd=tmp_path,
    )  # fmt: skip
    imported = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert not imported.intersection(slow)


def test_a_rig_copied_elsewhere_still_runs(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    """A material file beside the rig is found from wherever labrig is called, and at resume."""
    place = tmp_path / "elsewhere"
    place.mkdir()
    (place / "mine.yaml").write_text(
        "name: mine\nkind: phosphor\nbands_nm: [400, 550, 700]\n"
        + "states: [{k_r_per_s: 0.05, reradiation: [2.0, 2.0]}]\n"
    )
    rig = make_rig(sample="mine.yaml").rename(place / "rig.yaml")
    ended = labrig("run", make_protocol(), "--rig", rig, "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    fit = json.loads((ended.run_folder / "result" / "fit.json").read_text())
    assert fit["states"][0]["k_r_per_s"] == pytest.approx(0.05, rel=0.02)
    assert labrig("resume", ended.run_folder).code == 0


def test_a_run_whose_every_frame_clips_is_kept_and_reported(
    labrig: Labrig, make_rig: Make, make_protocol: Make, tmp_path: Path
) -> None:
    ended = labrig(
        "run", make_protocol(exposure="3.2 s", camera={"iso": 1600, "f_number": 4}), "--rig",
        make_rig(sample="stickers"), "--runs", tmp_path / "runs",
    )  # fmt: skip
    one_line(ended, 4, "all are clipped", "the run is kept")
    (folder,) = (tmp_path / "runs").iterdir()
    assert "clipped" in (folder / "result" / "report.html").read_text()


def test_a_table_of_time_and_value_is_fitted_with_the_defaults(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    rng = np.random.default_rng(5)
    t_s = np.arange(0.0, 80.0, 2.0)
    values = 1000 * np.exp(-0.05 * t_s) + rng.normal(0, 5, len(t_s))
    rows = [f"{t},{value}" for t, value in zip(t_s, values, strict=True)]
    (tmp_path / "table.csv").write_text("\n".join(["time_s,counts", *rows]))
    ended = labrig("fit", "decay", tmp_path / "table.csv", "--json")
    assert ended.code == 0, ended.err
    fit = json.loads(ended.out)
    rate = fit["states"][0]
    assert abs(rate["k_r_per_s"] - 0.05) < 4 * rate["k_r_per_s_sigma"]
    assert fit["warnings"] == []
    assert fit["sigma_from_scatter"]["at_brightest"] == pytest.approx(5, rel=0.3)
    assert "from the scatter" in labrig("fit", "decay", tmp_path / "table.csv").out


def test_a_table_has_page_figures_and_result_as_a_run_has(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    rng = np.random.default_rng(5)
    t_min = np.arange(0.0, 2.0, 0.05)
    values = 1000 * np.exp(-0.05 * 60 * t_min) + rng.normal(0, 5, len(t_min))
    rows = [f"{t};{value}".replace(".", ",") for t, value in zip(t_min, values, strict=True)]
    table = tmp_path / "paint.csv"
    table.write_text("\n".join(["Zeit / min;Signal [mV]", *rows]), encoding="utf-16")
    ended = labrig("fit", "decay", table, "--out", tmp_path / "out")
    assert ended.code == 0, ended.err
    result = tmp_path / "out" / "result"
    assert ended.out.splitlines()[-1] == f"report: {result / 'report.html'}"
    assert all(path.suffix == ".svg" for path in (result / "figures").iterdir())
    assert len(list((result / "figures").iterdir())) >= 3
    read = read_result(tmp_path / "out")
    assert isinstance(read, DecayResult)
    fit = read.fits["paint"]
    assert fit.scatter is not None
    assert fit.rates[0].value == pytest.approx(0.05, rel=0.05)
    assert fit.scatter.at_brightest == pytest.approx(5, rel=0.3)
    page = (result / "report.html").read_text(encoding="utf-8")
    assert "mV" in page
    assert "DN/s" not in page
    assert "from the scatter about the best monotone curve" in page
    again = labrig("fit", "decay", table, "--out", tmp_path / "out")
    assert "the same result as before" in again.out
    other = labrig("fit", "decay", table, "--out", tmp_path / "out", "--from", "6 s")
    assert "start: none → 6 s" in other.out
    assert (tmp_path / "out" / "result-1" / "fit.json").is_file()


def test_the_columns_of_a_table_without_names_are_told(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    rows = [f"{t},{100 * np.exp(-t / 20)},{60 * np.exp(-t / 20)}" for t in range(0, 80, 2)]
    (tmp_path / "table.csv").write_text("\n".join(rows))
    ended = labrig("fit", "decay", tmp_path / "table.csv")
    assert ended.out.splitlines()[0] == (
        "columns  time column 1 (s, as no line states another unit); values column 2; σ column 3"
    )
    assert "σ is too large" in ended.out
    (tmp_path / "out").touch()
    refused = labrig("fit", "decay", tmp_path / "table.csv", "--out", tmp_path / "out")
    one_line(refused, 2, "--out: expected a folder")
    assert refused.out == ""


def test_the_page_of_a_table_tells_nothing_of_a_camera(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    rows = [f"{t},{100 * np.exp(-t / 20)}" for t in range(0, 80, 2)]
    (tmp_path / "table.csv").write_text("\n".join(["t,Current / nA", *rows]))
    assert labrig("fit", "decay", tmp_path / "table.csv", "--out", tmp_path / "out").code == 0
    page = (tmp_path / "out" / "result" / "report.html").read_text(encoding="utf-8")
    assert "nA s" in page
    for word in ("DN", "LibRaw", "the lens and", "averaged over the exposure"):
        assert word not in page


def test_the_page_tells_how_many_of_the_states_asked_for_there_are(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    rng = np.random.default_rng(5)
    rows = [f"{t},{100 * np.exp(-t / 20) + rng.normal()}" for t in range(0, 80, 2)]
    (tmp_path / "table.csv").write_text("\n".join(["t,I", *rows]))
    labrig("fit", "decay", tmp_path / "table.csv", "--states", "3", "--out", tmp_path / "out")
    result = read_result(tmp_path / "out")
    assert isinstance(result, DecayResult)
    supported = result.fits["table"].n_states
    assert supported < 3
    page = (tmp_path / "out" / "result" / "report.html").read_text(encoding="utf-8")
    assert f"was set to 3, of which the data support n = {supported}" in page


OPEN_TABLES = [
    ("t,A,B\n0,9,8\n1,5,4\n2,3,2\n", 2, "--column A"),
    ("wl,counts\n400,9\n410,5\n", 2, "--time NAME"),
    ("t [frames],A\n0,9\n1,5\n", 2, "--time-unit"),
    ("t\tA\n1,234\t9,000\n2,345\t5,000\n", 2, "--decimal comma"),
    ("t,A\n-5,9\n1,5\n2,3\n", 2, "--from 0"),
    ("t,A\n" + "".join(f"{k},{min(k, 30 - k)}\n" for k in range(30)), 4, "--from 15"),
]


@pytest.mark.parametrize(("text", "code", "option"), OPEN_TABLES)
def test_a_table_that_leaves_something_open_is_asked_for_an_option(
    labrig: Callable[..., Ended], tmp_path: Path, text: str, code: int, option: str
) -> None:
    (tmp_path / "table.csv").write_text(text)
    one_line(labrig("fit", "decay", tmp_path / "table.csv"), code, option)


def test_an_earlier_result_is_restored(labrig: Labrig, finished: Path) -> None:
    before = (finished / "result" / "result.json").read_bytes()
    assert labrig("process", finished, "--states", "2").code == 0
    assert read_yaml(finished / "result" / "provenance.yaml")["given"] == ["--states 2"]
    after = (finished / "result" / "result.json").read_bytes()
    assert after != before
    (newest,) = sorted(finished.glob("result-*"), key=lambda each: int(each.name[7:]))[-1:]
    assert (newest / "result.json").read_bytes() == before
    restored = labrig("runs", "restore", finished, newest.name)
    assert (restored.code, restored.out.splitlines()[0]) == (
        0,
        f"{finished}: {newest.name} is its result again",
    )
    assert (finished / "result" / "result.json").read_bytes() == before
    kept = {each.name: (each / "result.json").read_bytes() for each in finished.glob("result-*")}
    assert after in kept.values()
    assert newest.name not in kept
    one_line(labrig("runs", "restore", finished, "result-77"), 2, "expected the name of an earlier")
    labrig("process", finished, "--states", "2")
    again = labrig("process", finished, "--roi", "0.3,0.3,0.4,0.4").err
    assert "not kept from the result before: --states 2; " in again
    assert f"labrig process {finished} --states 2 --roi 0.3,0.3,0.4,0.4" in again
    assert "--roi" in labrig("process", finished).err
    assert "not kept" not in labrig("process", finished).err
