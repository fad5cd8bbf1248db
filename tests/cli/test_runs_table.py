"""The table of samples: of any width, with pictures where a terminal shows some, and as CSV."""

import csv
import io
import math
import re
from base64 import b64decode
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import click
import pytest

from labrig.catalogue import RunSummary
from labrig.cli.inline_picture import InlinePictures
from labrig.cli.runs_table import runs_csv, samples_table
from labrig.results import SAMPLE_PICTURE, Measured

MADE = datetime(2026, 1, 1, tzinfo=UTC)
PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 40
RATES = {
    "k_r_per_s 1": Measured(0.20481, 0.0031, "1/s"),
    "k_r_per_s 2": Measured(1.009e-5, 1.2e-7, "1/s"),
}
DECAY = RunSummary(
    Path("runs/2026-01-01T00-00-00_decay_blue-paint"), "blue-paint", "decay", MADE, MADE,
    "processed", 3, 3, 37, {"left": RATES, "right": RATES},
    {"left: k_r of state 1": RATES["k_r_per_s 1"]},
)  # fmt: skip
ALBEDO = replace(
    DECAY, folder=Path("runs/albedo"), sample="=1+1", parameters={},
    values={"albedo at 450 nm": Measured(0.4985, math.inf), "glow": Measured(-2.5, 0.5, "%")},
    headline="albedo 0.4985 ± 0.0061 at 450 nm, 0.4993 ± 0.0061 at 550 nm, 0.4998 ± 0.0061 at "
    "650 nm and more that is not shown",
)  # fmt: skip
OTHER = replace(DECAY, folder=Path("runs/other"), sample="石膏", status="failed", done=1)
NUMBERS = ["0.2048 ± 0.0031", "(1.009 ± 0.012) × 10⁻⁵ 1/s"]


def table(runs: list[RunSummary], columns: int | None) -> list[str]:
    return click.unstyle(samples_table(runs, columns, None)).splitlines()


@pytest.mark.parametrize("columns", [50, 80, 120, None])
def test_no_number_is_broken_at_any_width(columns: int | None) -> None:
    lines = table([DECAY, ALBEDO, OTHER, DECAY], columns)
    assert [line for line in lines if line[0] != " "] == ["=1+1", "石膏", "blue-paint"]
    assert all(len(line) <= (columns or 1000) for line in lines)
    for number in NUMBERS:
        assert sum(number in line for line in lines) == 6
    albedos = re.findall(r"[\d.]+ ± [\d.]+ at", "\n".join(lines))
    assert albedos == ["0.4985 ± 0.0061 at", "0.4993 ± 0.0061 at", "0.4998 ± 0.0061 at"]
    assert any("failed, 1 of 3" in line for line in lines)


def test_a_spreadsheet_has_a_row_a_run_and_runs_nothing() -> None:
    head, *rows = csv.reader(io.StringIO(runs_csv([DECAY, ALBEDO])))
    decay, albedo = (dict(zip(head, row, strict=True)) for row in rows)
    assert float(decay["left: k_r of state 1 (1/s)"]) == 0.20481
    assert float(decay["left: k_r of state 1_sigma (1/s)"]) == 0.0031
    assert (decay["albedo at 450 nm"], decay["result"]) == ("", "")
    assert (albedo["sample"], albedo["began_utc"]) == ("'=1+1", "2026-01-01T00:00:00Z")
    assert (albedo["albedo at 450 nm"], albedo["albedo at 450 nm_sigma"]) == ("0.4985", "")
    assert albedo["glow (%)"] == "-2.5"


@pytest.mark.parametrize(
    ("environment", "payload"),
    [
        ({"TERM": "xterm-kitty"}, r"\x1b_G[^;]*;([^\x1b]*)\x1b\\"),
        ({"TERM_PROGRAM": "iTerm.app"}, r"\x1b]1337;File=[^:]*:([^\x07]*)\x07"),
        ({"TERM_PROGRAM": "iTerm.app", "TMUX": "/tmp/tmux"}, None),
        ({"TERM": "xterm-256color"}, None),
    ],
)
@pytest.mark.parametrize("is_terminal", [True, False])
def test_only_a_terminal_that_shows_pictures_gets_them(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    environment: dict[str, str],
    payload: str | None,
    is_terminal: bool,
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: is_terminal, raising=False)
    pictures = InlinePictures.of_terminal(environment)
    if payload is None or not is_terminal:
        assert pictures is None
        return
    assert pictures is not None
    (tmp_path / "result").mkdir()
    run = replace(DECAY, folder=tmp_path)
    assert pictures.of([run]) == ""
    (tmp_path / "result" / SAMPLE_PICTURE).write_bytes(PNG)
    shown = samples_table([run], 100, pictures)
    assert b64decode("".join(re.findall(payload, shown))) == PNG
    assert "1337" not in samples_table([run], 50, pictures)
    (tmp_path / "result" / SAMPLE_PICTURE).write_bytes(b"no picture")
    assert pictures.of([run]) == ""
