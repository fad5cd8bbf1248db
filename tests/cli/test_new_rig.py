"""`labrig rig new`: a rig file from simulated boards, in a dialogue and by options alone."""

import io
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from labrig.acquire import plan, planned_rig, read_protocol, read_rig_file
from labrig.foundation import resources
from labrig.foundation.yaml_file import read_yaml, yaml_text
from labrig.setup import Host
from tests.conftest import Ended, write_short_decay

Labrig = Callable[..., Ended]


@pytest.fixture
def room(tmp_path: Path) -> Callable[[str], Path]:
    """Return a function that writes a shipped simulated rig with a small sensor."""

    def write(name: str) -> Path:
        content = read_yaml(resources.names("config")[name])
        content["simulation"]["sensor"] = {"width": 96, "height": 64}
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml_text(content))
        return path

    return write


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that types lines, and keys, for the commands that follow."""

    def type_in(*lines: str) -> None:
        monkeypatch.setattr(sys, "stdin", io.StringIO("".join(f"{line}\n" for line in lines)))

    return type_in


@pytest.mark.parametrize("name", ["sim", "sim-arduino", "sim-phosphor"])
def test_a_rig_file_made_without_a_question_is_fine_in_a_check(
    name: str, labrig: Labrig, room: Callable[[str], Path], tmp_path: Path
) -> None:
    made = tmp_path / "made.yaml"
    ended = labrig("rig", "new", made, "--simulated", room(name), "--yes", "--name", "attic")
    assert (ended.code, ended.err) == (0, "")
    assert f"labrig plan decay --rig {made}" in ended.out
    rig, shipped = read_rig_file(made), read_rig_file(resources.names("config")[name])
    assert rig.name == "attic"
    assert set(rig.devices) == set(shipped.devices)
    assert rig.devices["camera"].settings()["isos"] == [100, 200, 400, 800, 1600, 3200]
    assert "# measured: switch on, read back:" in made.read_text()
    assert labrig("rig", "check", made).code == 0


def test_a_decay_runs_at_once_on_the_new_file(
    labrig: Labrig, room: Callable[[str], Path], tmp_path: Path
) -> None:
    made = tmp_path / "made.yaml"
    assert labrig("rig", "new", made, "--simulated", room("sim"), "--yes").code == 0
    decay = write_short_decay(tmp_path / "decay.yaml")
    ended = labrig("run", decay, "--rig", made, "--runs", tmp_path / "runs")
    assert ended.code == 0
    assert (ended.run_folder / "result" / "report.html").is_file()


def test_a_person_chooses_devices_sees_the_lamp_and_moves_the_door(
    labrig: Labrig, room: Callable[[str], Path], tmp_path: Path, answers: Callable[..., None]
) -> None:
    made = tmp_path / "made.yaml"
    given = ["--without", "shield", "--without", "thermometer", "--without", "changer"]
    answers(
        "cellar",
        *("", "1", "20"),  # the lamp, another relay, a warm-up without its unit …
        "20 min",  # … which is asked for again
        *("", "0", "1000 us", "2000 us", "300 ms"),  # the door
        *("", "", "", ""),  # the camera, three keys
        "",  # connect
        *("n", "0", ""),  # it did not shine: another relay
        "y",
        "++>",  # 120 us more are closed
        "<-",  # 110 us less are open
        *("", ""),  # its travel, in no time
    )
    ended = labrig("rig", "new", made, "--simulated", room("sim-phosphor"), *given)
    assert ended.code == 0, ended.err
    assert "such as '20 min'" in ended.out
    rig = read_rig_file(made)
    assert rig.name == "cellar"
    assert list(rig.devices) == ["lamp", "door", "camera"]
    assert rig.devices["lamp"].settings()["relay"] == 0
    assert rig.devices["lamp"].warm_up == 1200
    assert rig.devices["door"].settings() | {"channel": 0} == {
        "channel": 0, "closed": "1120 us", "open": "1890 us", "travel": "300 ms",
    }  # fmt: skip


def test_keys_are_given_by_options_and_what_is_wrong_is_named(
    labrig: Labrig, room: Callable[[str], Path], tmp_path: Path
) -> None:
    made = tmp_path / "made.yaml"
    new = ["rig", "new", made, "--yes", "--no-check", "--simulated", room("sim")]
    assert labrig(*new, "--set", "lamp.relay=2", "--set", "camera.shutter_lag=80 ms").code == 0
    rig = read_rig_file(made)
    assert rig.devices["lamp"].settings()["relay"] == 2
    assert rig.devices["camera"].settings()["shutter_lag"] == "80 ms"
    again = labrig(*new)
    assert (again.code, again.err.count("\n")) == (2, 1)
    assert "is there already" in again.err
    made.unlink()
    for wrong, said in {
        "lamp.relay=many": "lamp: relay: expected a whole number",
        "lamp.rely=2": "did you mean 'relay'",
        "lmap.relay=2": "did you mean 'lamp'",
        "relay=2": "expected DEVICE.KEY=VALUE",
        "lamp.driver=numata": "unknown driver 'numata'; did you mean 'numato'",
    }.items():
        ended = labrig(*new, "--set", wrong)
        assert (ended.code, ended.err.count("\n")) == (2, 1)
        assert said in ended.err
        assert not made.exists()


def test_boards_and_cameras_of_this_pc_make_a_file_that_plans(
    labrig: Labrig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def port(device: str, vid: int, pid: int) -> SimpleNamespace:
        return SimpleNamespace(device=device, description="", vid=vid, pid=pid, serial_number="A1")

    ports = [
        port("/dev/ttyACM0", 0x2A19, 0x0C01),
        port("/dev/ttyACM1", 0x1FFB, 0x008A),
        port("/dev/ttyUSB0", 0x1A86, 0x7523),
    ]
    host = Host("linux", lambda: ports, lambda: [], lambda: [])
    monkeypatch.setattr(Host, "of_this_pc", lambda: host)
    made = tmp_path / "made.yaml"
    camera = ["--set", "camera.driver=ptp_camera", "--set", "camera.address=usb://04a9:3199"]
    ended = labrig("rig", "new", made, "--yes", "--no-check", *camera)
    assert ended.code == 0, ended.err
    rig = read_rig_file(made)
    assert [entry.driver for entry in rig.devices.values()] == ["numato", "maestro", "ptp_camera"]
    assert "CH340" in made.read_text()
    assert "#   driver: lcus" in made.read_text()
    protocol, _ = read_protocol(resources.names(resources.PROTOCOLS)["decay"]).adapted_to(
        planned_rig(rig, str(made)), chosen=()
    )
    assert plan(protocol, rig, str(made)).frames > 30


def test_without_any_device_the_ways_to_one_are_named(
    labrig: Labrig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    host = Host("linux", lambda: [], lambda: [], lambda: [])
    monkeypatch.setattr(Host, "of_this_pc", lambda: host)
    ended = labrig("rig", "new", tmp_path / "made.yaml", "--yes")
    assert ended.code == 2
    assert "--set lamp.driver=numato" in ended.err
    assert "--simulated sim" in ended.err


def test_answers_are_kept_where_a_device_does_not_answer(
    labrig: Labrig, room: Callable[[str], Path], tmp_path: Path, answers: Callable[..., None]
) -> None:
    made = tmp_path / "made.yaml"
    absent = ["--set", "camera.address=sim://room/spectrometer"]
    given = ["--set", "camera.driver=ptp_camera", *absent]
    ended = labrig("rig", "new", made, "--simulated", room("sim"), "--yes", *given)
    assert ended.code == 3
    assert f"{made} is written, without what could not be measured" in ended.err
    assert read_rig_file(made).devices["camera"].address == "sim://room/spectrometer"
    answers()
    ended = labrig("rig", "new", tmp_path / "other.yaml", "--simulated", room("sim"))
    assert ended.code == 2
    assert "nobody can answer here" in ended.err
