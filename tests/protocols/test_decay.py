"""The decay protocol: its timeline, what it refuses, and what it measures in a simulated room."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.acquire import Plan, plan, read_protocol, read_rig_file
from labrig.foundation import resources
from labrig.foundation.errors import ProtocolError, UsageError
from labrig.foundation.yaml_file import read_yaml
from labrig.record import read_run
from tests.conftest import Ended
from tests.quick_yaml import write_quickly

GOLDEN = Path(__file__).parent / "decay.timeline.txt"
#: A calibration's check is planned where there is a calibration: `tests.test_found_calibrations`.
PROTOCOLS = sorted(name for name in resources.names("protocols") if name != "calibration_check")


def planned(protocol: Path, rig: str | Path = "sim") -> Plan:
    rig_path = resources.find("config", "rig", rig)
    return plan(read_protocol(protocol), read_rig_file(rig_path), str(rig_path))


def test_the_timeline_of_the_shipped_protocol_is_as_agreed() -> None:
    laid_out = planned(resources.find("protocols", "protocol", "decay"))
    assert "\n".join(laid_out.lines()) + "\n" == GOLDEN.read_text()


@pytest.mark.parametrize("rig", ["sim", "sim-phosphor"])
@pytest.mark.parametrize("name", PROTOCOLS)
def test_every_shipped_protocol_can_be_planned(name: str, rig: str) -> None:
    # One rig has a bank of LEDs.
    lit = ("led_", "direct_", "angular_", "validate_")
    rig = "sim-fluorescent" if name.startswith(lit) else rig
    # And one the reading of a luxmeter.
    rig = "sim-luminance" if name == "luminance" else rig
    laid_out = planned(resources.find("protocols", "protocol", name), rig)
    assert laid_out.duration_s > 1800
    # A direct measurement reads spectra only.
    assert laid_out.frames > 20 or name == "direct_bispectral"


def test_the_shipped_decay_runs(
    labrig: Callable[..., Ended], make_rig: Callable[..., Path], tmp_path: Path
) -> None:
    """The one of eleven patches does, too: tests/test_materials.py."""
    ended = labrig("run", "decay", "--rig", make_rig(), "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    assert (ended.run_folder / "result" / "report.html").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"exposure": "8 s"}, "(every: 9.2 s)"),
        ({"exposure": "4.5 s"}, "(every: 6.3 s)"),
        ({"exposure": "0.5 s", "every": "0.5 s"}, "(every: 1.7 s)"),
        ({"exposure": "auto", "every": "0.5 s"}, "(every: 1.7 s)"),
        ({"camera": {"iso": 3200, "f_number": 4}}, "does not offer ISO 3200"),
        ({"camera": {"iso": 400, "f_number": 1.2}}, "cannot be set to f/1.2"),
        ({"exposure": "1/100000 s"}, "does not offer an exposure"),
        ({"exposure": "1/4096 s", "every": "2 s", "for": "100000 h"}, "take fewer"),
    ],
)
def test_a_plan_that_cannot_work_is_refused(
    make_protocol: Callable[..., Path], keys: dict[str, object], said: str
) -> None:
    with pytest.raises((ProtocolError, UsageError)) as caught:
        planned(make_protocol(**keys))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_plan_for_a_driver_of_another_kind_is_refused(
    make_protocol: Callable[..., Path], make_rig: Callable[..., Path]
) -> None:
    rig = make_rig()
    rig.write_text(rig.read_text().replace("ptp_camera", "numato"))
    with pytest.raises(UsageError, match="is no camera"):
        plan(read_protocol(make_protocol()), read_rig_file(rig), str(rig))


def test_a_plan_without_end_is_refused(
    make_protocol: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("labrig.acquire.planner.MAX_STEPS", 300)
    with pytest.raises(ProtocolError, match="at most 300 steps"):
        planned(make_protocol(repeats=1000))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"exposur": "1 s"}, "did you mean 'exposure'?"),
        ({"exposure": "bright"}, "expected auto or grow, or a duration"),
        ({"exposure": 1}, "exposure"),
        ({"charge": "forever"}, "expected plateau, or a duration"),
        ({"for": "3 s"}, "leaves no two frames"),
        ({"dark": "background"}, "needs the key 'background"),
        ({"patches": {}}, "patches"),
        ({"patches": {"a": [0, 0, 10.5, 3]}}, "whole pixels"),
        ({"states": 4}, "states"),
        ({"sample": {"nam": "x"}}, "did you mean 'name'?"),
        ({"repeats": 0}, "repeats"),
        ({"repeats": 100_000_000}, "repeats"),
    ],
)
def test_a_misspelt_or_impossible_key_is_one_clear_line(
    make_protocol: Callable[..., Path], keys: dict[str, object], said: str
) -> None:
    path = make_protocol(**keys)
    with pytest.raises(UsageError) as caught:
        read_protocol(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert said in str(caught.value)


def test_a_written_protocol_reads_back_as_itself(make_protocol: Callable[..., Path]) -> None:
    for keys in ({}, {"charge": "plateau", "exposure": "grow"}, {"dark": "background",
                 "background": [0, 0, 0.1, 0.1]}):  # fmt: skip
        protocol = read_protocol(make_protocol(**keys))
        path = make_protocol()
        path.write_text(write_quickly(protocol.model_dump(mode="json", by_alias=True)))
        assert read_protocol(path) == protocol


def test_metering_keeps_an_unknown_brightness_from_clipping(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    """Stickers glow several hundred times as bright as green paint after a minute."""
    for sample in ("stickers", "green-paint"):
        ended = labrig(
            "run", make_protocol(exposure="auto"), "--rig", make_rig(sample=sample),
            "--runs", tmp_path / sample,
        )  # fmt: skip
        assert ended.code == 0, ended.err
        assert "clipped" not in (ended.run_folder / "result" / "series.csv").read_text()


def test_growing_exposures_keep_counts_along_the_decay(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    ended = labrig(
        "run", make_protocol(exposure="grow", grow_at_most=8), "--rig", make_rig(),
        "--runs", tmp_path / "runs",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    exposures_s = [frame.exposure_s for frame in read_run(ended.run_folder).frames("decay")]
    assert exposures_s == sorted(exposures_s)
    assert 3 < exposures_s[-1] / exposures_s[0] <= 8.01


def test_a_charge_until_the_plateau_ends_when_the_glow_stops_growing(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    protocol = make_protocol(
        charge="plateau",
        plateau={"growth": "3 %", "check_every": "60 s", "at_most": "60 min"},
    )
    rig = read_yaml(make_rig())
    rig["devices"]["lamp"]["warm_up"] = "30 s"
    path = tmp_path / "cold.yaml"
    path.write_text(write_quickly(rig))
    ended = labrig("run", protocol, "--rig", path, "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    run = read_run(ended.run_folder)
    assert 2 <= len(run.frames("plateau")) < 10
    times_s = [
        float(line.split(",")[0])
        for line in (ended.run_folder / "result" / "series.csv").read_text().splitlines()[1:]
    ]
    assert min(times_s) == pytest.approx(0.56, abs=0.03), "time counts from the last lamp off"


def test_a_dark_region_takes_the_place_of_dark_frames(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    protocol = make_protocol(dark="background", background=[0.0, 0.0, 1.0, 0.08])
    ended = labrig("run", protocol, "--rig", make_rig(), "--runs", tmp_path / "runs")
    assert ended.code == 0, ended.err
    assert read_run(ended.run_folder).frames("dark") == []
    (state,) = json.loads((ended.run_folder / "result" / "fit.json").read_text())["states"]
    assert abs(state["k_r_per_s"] - 0.032) < 3 * state["k_r_per_s_sigma"]
    assert state["k_r_per_s_sigma"] < 0.001


def test_repeats_share_one_fit(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    sigmas = []
    for repeats in (1, 4):
        protocol = make_protocol(repeats=repeats)
        ended = labrig("run", protocol, "--rig", make_rig(), "--runs", tmp_path / str(repeats))
        assert ended.code == 0, ended.err
        (state,) = json.loads((ended.run_folder / "result" / "fit.json").read_text())["states"]
        assert abs(state["k_r_per_s"] - 0.032) < 3 * state["k_r_per_s_sigma"]
        sigmas.append(state["k_r_per_s_sigma"])
    assert sigmas[1] < 0.75 * sigmas[0]
