"""A run without a spectrometer that its protocol does not use, or whose package is missing."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from labrig.record import read_run
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly

Labrig = Callable[..., Ended]


@pytest.fixture
def rig(make_rig: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The shipped bench with LEDs, where python-seabreeze is not installed."""
    for name in [name for name in sys.modules if name.split(".")[0] == "seabreeze"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "seabreeze", None)
    path = make_rig(base="sim-fluorescent")
    content = read_quickly(path.read_text())
    content["devices"]["camera"]["warm_up"] = "1 s"
    path.write_text(write_quickly(content))
    return path


def protocol(folder: Path, name: str, **keys: object) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(write_quickly({"protocol": name, "sample": {"name": "felt"}} | keys))
    return path


def test_a_protocol_without_spectra_does_without_the_spectrometer(
    labrig: Labrig, tmp_path: Path, rig: Path
) -> None:
    blank = protocol(
        tmp_path, "led_fluorescence", patches={"felt": [10, 10, 30, 30]},
        leds=["455 nm", "530 nm", "590 nm"], exposures=1, repeats=1,
    )  # fmt: skip
    ended = labrig("run", blank, "--rig", rig, "--runs", tmp_path, "--no-process", "--yes")
    assert ended.code == 0, ended.err
    attempts = read_run(ended.run_folder).attempts
    opened = {"leds", "illuminants", "camera", "changer"}
    assert all(it.start["devices"].keys() == opened for it in attempts)
    assert "spectrometer:" in (ended.run_folder / "rig.yaml").read_text()


def test_one_with_spectra_says_what_to_install(labrig: Labrig, tmp_path: Path, rig: Path) -> None:
    spectra = protocol(tmp_path, "led_brightness")
    ended = labrig("run", spectra, "--rig", rig, "--runs", tmp_path, "--yes")
    assert ended.code == 2
    assert "pip install 'labrig[seabreeze]'" in ended.err
