"""`labrig fit decay` by the command line."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.conftest import Ended


def test_what_was_said_of_the_table_is_in_the_provenance(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    counts = np.random.default_rng(41).poisson(2000 * np.exp(-0.05 * np.arange(80.0)))
    table = tmp_path / "channels.txt"
    table.write_text("Chan\tData\n" + "".join(f"{n}\t{c}\n" for n, c in enumerate(counts)))
    said = ("--time-per-channel", "0.5 s", "--weights", "counts", "--from", "1", "--states", "1")
    ended = labrig("fit", "decay", table, *said, "--out", tmp_path / "made")
    assert ended.code == 0, ended.err
    made = (tmp_path / "made" / "result" / "provenance.yaml").read_text(encoding="utf-8")
    options = {line.split(":")[0].strip(): line.split(":", 1)[1].strip(" '\"")
               for line in made.splitlines() if line.startswith("  ")}  # fmt: skip
    assert options["time_per_channel"] == "0.5 s"
    assert (options["weights"], options["start"], options["states"]) == ("counts", "1", "1")
    assert "block" not in options


def test_all_intervals_are_printed_and_written_as_asked(
    labrig: Callable[..., Ended], tmp_path: Path
) -> None:
    t_s = np.arange(0.0, 100.0, 2.0)
    values = np.exp(-0.04 * t_s) + 0.01 * np.random.default_rng(2).standard_normal(len(t_s))
    table = tmp_path / "glow.csv"
    columns = np.transpose([t_s, values, np.full_like(t_s, 0.01)])
    np.savetxt(table, columns, header="t_s,y,sigma", delimiter=",", comments="")
    command = ("fit", "decay", table, "--states", "1")
    assert "68 %" not in labrig(*command).out
    ended = labrig(*command, "--intervals", "--out", tmp_path / "made")
    assert ended.code == 0, ended.err
    assert "k 1 / s⁻¹" in ended.out
    assert "1/k 1 / s" in ended.out
    fit = json.loads(labrig(*command, "--intervals", "--json").out)
    low, high = fit["intervals"]["k_r_per_s 1"]["interval_95"]
    assert low < 0.04 < high
    assert fit["intervals"]["lifetime_s 1"]["possible"] == [0.0, None]
    page = (tmp_path / "made" / "result" / "report.html").read_text(encoding="utf-8")
    assert "Intervals" in page
