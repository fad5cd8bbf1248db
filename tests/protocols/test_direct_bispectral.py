"""The direct measurement of a matrix: its timeline, refusals, hands, faults and resumption."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import plan, read_protocol, read_rig_file
from labrig.process import process_run
from labrig.protocols.direct_bispectral.protocol import DirectBispectral
from labrig.protocols.direct_bispectral.result import DirectBispectralResult
from labrig.record import read_run
from tests.analyse.direct_bench import write_bench
from tests.conftest import Ended
from tests.protocols.protocol_files import (
    assert_one_clear_line,
    assert_timeline_as_agreed,
    written,
)
from tests.quick_yaml import read_quickly, write_quickly

NAME = "direct_bispectral"
QUICK: dict[str, Any] = {"leds": ["430 nm"], "samples": ["felt"], "repetitions": 4}


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    assert_timeline_as_agreed(NAME, "sim-fluorescent")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"leds": ["430 nm", "430 nm"]}, "expected every LED once"),
        ({"leds": []}, "leds"),
        ({"samples": ["felt", "felt"]}, "expected every sample once"),
        ({"samples": ["white"]}, "other than 'white'"),
        ({"samples": ["a/b"]}, "can be folders"),
        ({"first_band": 700, "last_band": 700}, "'last_band' above 'first_band'"),
        ({"longest": "20 s"}, "longest"),
        ({"sample_names": ["felt"]}, "sample_names"),
    ],
)
def test_what_cannot_be_is_one_clear_line(tmp_path: Path, keys: dict[str, Any], said: str) -> None:
    assert_one_clear_line(written(tmp_path, protocol=NAME, **keys), said)


def test_every_light_is_read_on_white_and_on_every_sample_and_the_first_once_more() -> None:
    protocol = DirectBispectral(samples=("felt", "paper"))
    order = protocol.shuffled()
    assert sorted(order) == sorted(protocol.leds)
    assert list(order) != list(protocol.leds)
    names = [unit.name for unit in protocol.units()]
    expected = []
    for stage in ("white", "felt", "paper"):
        lit = [f"{stage}: {light}" for light in order]
        expected += [f"{stage}: dark", *lit, f"again {lit[0]}"]
    assert names == [*expected, "put-back"]


def test_filters_before_the_lamp_are_put_in_by_hand(tmp_path: Path) -> None:
    filters = ["bandpass-450", "bandpass-550"]
    path = written(tmp_path, protocol=NAME, filters=filters, samples=["felt"])
    rig_file = read_rig_file(write_bench(tmp_path))
    laid_out = plan(read_protocol(path), rig_file, "rig.yaml")
    steps = [step.action for step in laid_out.steps if step.device == "person"]
    assert [text for text in steps if text.startswith("put the filter bandpass-450")]
    assert steps[-1] == "take the filter out"
    # The lamp warms up once for white and once for the sample, since darks are read between.
    assert sum("lamp warms up" in step.action for step in laid_out.steps) == 2


def test_a_spectrometer_that_is_unplugged_ends_the_run_and_it_is_resumed(
    tmp_path: Path, labrig: Callable[..., Ended]
) -> None:
    fault = {"spectrometer_unplugged": {"at": "6 min"}}
    rig = write_bench(tmp_path, faults=[fault])
    runs = tmp_path / "runs"
    protocol = written(tmp_path, protocol=NAME, **QUICK)
    ended = labrig("run", protocol, "--rig", rig, "--runs", runs, "--yes", "--no-process")
    assert ended.code == 3
    (said,) = [line for line in ended.err.splitlines() if line.startswith("labrig: ")]
    assert "spectrometer" in said
    (folder,) = runs.iterdir()
    assert list(read_run(folder).completed())[:2] == ["white: dark", "white: 430 nm"]
    content = read_quickly((folder / "rig.yaml").read_text())
    content["simulation"] |= {"faults": []}
    (folder / "rig.yaml").write_text(write_quickly(content))
    assert labrig("resume", folder, "--edited", "--yes", "--no-process").code == 0
    # The samples lay in the white reference's place when the devices were connected again.
    result = process_run(folder)
    assert isinstance(result, DirectBispectralResult)
    assert result.warnings == ()
    assert list(result.samples) == ["felt"]
