"""`labrig fit decay` by the command line."""

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
