"""Every shipped protocol on every shipped rig: it is laid out, or refused for a named reason."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from labrig.acquire import ProtocolModel, RigFile, plan, planned_rig, read_protocol, read_rig_file
from labrig.bench import Recording
from labrig.foundation import resources
from labrig.foundation.errors import LabrigError

RIGS = resources.names("config")
PROTOCOLS = resources.names(resources.PROTOCOLS)

#: What a protocol needs beside a camera, where that is not a lamp: keys of devices in this order.
DEVICES = {
    "angular_fluorescence": ["leds"],
    "direct_bispectral": ["leds", "spectrometer"],
    "led_brightness": ["leds"],
    "led_fluorescence": ["leds"],
    "validate_illuminants": ["illuminants"],
}
NOUNS = {
    "lamp": "a lamp",
    "leds": "a bank of LEDs",
    "illuminants": "a bank of lamps",
    "spectrometer": "a spectrometer",
}


def impossible(protocol: ProtocolModel, rig: RigFile) -> str:
    """Return a part of the message that a refusal has to have; empty if the plan is possible."""
    if protocol.protocol == "luminance" and rig.optics.luminance is None:
        return "expected a reading of a luxmeter"
    if protocol.protocol == "calibration_check":
        return "expected a calibration to check"
    for key in DEVICES.get(protocol.protocol, ["lamp"]):
        if key not in rig.devices:
            return f"the protocol needs {NOUNS[key]}"
    if protocol.protocol == "angular_fluorescence":
        lights = rig.devices["leds"].settings()["channels"]
        if "365 nm" not in lights:  # other LEDs would excite something else
            return "'365 nm', which the rig has not: it has 450 nm, 525 nm"
    return ""


@pytest.mark.parametrize("rig_name", RIGS)
def test_each_shipped_protocol_is_planned_or_impossible_for_a_reason(rig_name: str) -> None:
    rig = read_rig_file(RIGS[rig_name])
    stand_ins = planned_rig(rig, rig_name)
    for name, path in PROTOCOLS.items():
        protocol = read_protocol(path)
        reason = impossible(protocol, rig)
        try:
            adapted, _ = protocol.adapted_to(stand_ins, chosen=())
            laid_out = plan(adapted, rig, rig_name)
        except LabrigError as error:
            assert reason, f"{name} on {rig_name}: {error}"
            assert reason in str(error), f"{name} on {rig_name}"
        else:
            assert not reason, f"{name} on {rig_name} is planned"
            assert laid_out.frames or name == "direct_bispectral"


@pytest.fixture
def rig_file(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes the example bench with other lines."""

    def write(*changes: tuple[str, str]) -> Path:
        text = RIGS["example-lab"].read_text("utf-8").replace("27 MB", "1 MB")
        for before, after in changes:
            assert before in text
            text = text.replace(before, after)
        path = tmp_path / "rig.yaml"
        path.write_text(text, "utf-8")
        return path

    return write


def prepared(tmp_path: Path, rig: Path, protocol: str | Path, **changes: object) -> Recording:
    path = PROTOCOLS[protocol] if isinstance(protocol, str) else protocol
    return Recording.prepare(path, rig, tmp_path / "runs", changes)


def test_apertures_of_a_shipped_calibration_are_those_of_the_lens(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    recording = prepared(tmp_path, rig_file(("[2.8, 4, 5.6, 8]", "[3.5, 5, 9]")), "calibration")
    protocol: Any = recording.protocol
    camera, *_ = protocol.parts
    assert camera["f_numbers"] == [3.5, 5.0, 9.0]
    assert camera["camera"]["f_number"] == 3.5
    assert [each.key for each in recording.adaptations][:2] == [
        "camera_calibration: camera.f_number",
        "camera_calibration: f_numbers",
    ]
    assert any("f/3.5 in place of f/4" in note for note in recording.notes())


def test_nothing_is_changed_on_a_rig_that_has_it_all(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    rig = rig_file(("[2.8, 4, 5.6, 8]", "[2.8, 4, 5.6, 8, 11]"))
    recording = prepared(tmp_path, rig, "phosphor")
    assert recording.adaptations == ()


def test_a_slow_camera_has_frames_further_apart(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    rig = rig_file(("frame_time: 2 s", "frame_time: 10 s"))
    for name in ("decay", "emission_spectrum", "fade", "phosphor"):
        begins_s = [
            (step.at_s, step.exposure_s)
            for step in prepared(tmp_path, rig, name).plan.steps
            if step.exposure_s is not None
        ]
        gaps = pairwise(begins_s)
        assert all(later - at_s >= 10 + lasts_s - 0.02 for (at_s, lasts_s), (later, _) in gaps)


def test_what_a_person_chose_is_refused_by_its_key(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(
        "protocol: calibration\nparts:\n- protocol: fade\n  camera: {iso: 3200}\n", "utf-8"
    )
    with pytest.raises(LabrigError) as caught:
        prepared(tmp_path, rig_file(), own)
    assert str(caught.value).startswith(f"{own}: part fade: camera.iso: ")
    assert "ISO 1600 ('isos' of the rig file" in str(caught.value)
    with pytest.raises(LabrigError, match=r"camera_calibration: f_numbers: .* f/16;"):
        prepared(tmp_path, rig_file(), "camera_calibration", f_numbers=[4, 16])


def test_a_file_of_ones_own_is_adapted_where_it_leaves_a_key_out(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("protocol: camera_calibration\n", "utf-8")
    recording = prepared(tmp_path, rig_file(), own)
    protocol: Any = recording.protocol
    assert protocol.f_numbers == (2.8, 4.0, 5.6, 8.0)


def test_a_refusal_of_a_shipped_chain_says_how_to_get_a_file_to_change(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    with pytest.raises(LabrigError) as caught:
        prepared(tmp_path, rig_file(("frame_time: 2 s", "frame_time: 40 s")), "phosphor")
    assert "part blank: " in str(caught.value)
    assert "labrig protocol new phosphor" in str(caught.value)


def test_a_plan_shows_the_exposure_that_is_taken(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    recording = prepared(tmp_path, rig_file(), "decay", exposure="1.7 s")
    lines = recording.protocol.frame_spacing(recording.plan.capabilities)
    assert lines[0].startswith("1.7 s asked, 1.59 s taken")
    exact = prepared(tmp_path, rig_file(), "decay", exposure="1 s")
    lines = exact.protocol.frame_spacing(exact.plan.capabilities)
    assert not any("asked" in line for line in lines)


def test_a_chain_says_which_curves_it_lacks_and_what_a_calibration_would_save(
    tmp_path: Path, rig_file: Callable[..., Path]
) -> None:
    notes = prepared(tmp_path, rig_file(), "phosphor").notes()
    assert any("no spectrum of the lamp" in n and "fade, irradiance" in n for n in notes)
    assert any("no reflectance of the grey card" in note for note in notes)
    assert any("no colour filters" in n and "lvf_calibration asks" in n for n in notes)
    assert any("5 h 9 min and 66 steps by hand" in note for note in notes)
    (tmp_path / "filters").mkdir()
    (tmp_path / "filters" / "red.csv").write_text("wavelength_nm,value\n400,0\n700,1\n", "utf-8")
    curves = "optics:\n  lamp: halogen_3000k\n  grey_card: grey_card_18\n  filters: ./filters"
    rig = rig_file(("optics:", curves))
    notes = prepared(tmp_path, rig, "irradiance").notes()
    lacks = ("no spectrum of the lamp", "no reflectance of the grey card", "no colour filters")
    assert not any(lack in note for note in notes for lack in lacks)
