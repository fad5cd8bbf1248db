"""Calibrations that are kept beside the runs: found, checked, refused; on the simulated bench."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.acquire import CalibrationRules, RigFile, read_protocol, read_rig_file
from labrig.bench import Recording
from labrig.bench.found_calibrations import find_calibrations
from labrig.calibration import (
    CAMERA_KIND,
    FADE_KIND,
    IRRADIANCE_KIND,
    LEDS_KIND,
    REFERENCE_KIND,
    CameraFile,
    CardPicture,
    Change as ChangeInTime,
    FadeFile,
    ReferenceFile,
    keep_calibration,
    kept_calibrations,
)
from labrig.fit.lvf import compare_card_pictures, place_means
from labrig.foundation import resources
from labrig.foundation.errors import DataError, ProtocolError, UsageError
from labrig.optics import Flat, Strip
from labrig.process import process_run
from labrig.protocols.calibration_check.result import CalibrationCheckResult
from labrig.protocols.phosphor.protocol import Phosphor
from labrig.record import CALIBRATIONS_FILE, read_run
from labrig.reduce import find_strip, read_hdr_frame, strip_profile
from tests.analyse.excitation.bench import true_irradiance
from tests.analyse.led_bench import record as record_leds
from tests.analyse.recorded import record
from tests.protocols.protocol_files import written
from tests.quick_yaml import read_quickly, write_quickly

WIDTH, HEIGHT = 192, 64
MADE = datetime(2026, 1, 1, tzinfo=UTC)
LEDS = {"protocol": "led_brightness", "sample": {"name": "bank"}, "exposures": 1, "repeats": 1,
        "repetitions": 3, "integration": "0.2 s", "longest": "4 s",
        "leds": ["430 nm", "530 nm"]}  # fmt: skip
CHECK = {"protocol": "calibration_check", "longest": "1 s", "repeats": 1}
STRIP = Strip(left=(0.07, 0.46), right=(0.93, 0.51), height=0.3, rising=True)
NM = tuple(np.linspace(397.0, 703.0, 31).tolist())
FADE = FadeFile(
    bands_nm=(400.0, 700.0),
    fade=ChangeInTime(t_s=(0.0, 0.4), fraction=((1.0,), (0.0,)), sigma=((0.0,), (0.0,))),
)
ALL_RULES = ["age", "lens", "brightness", "colour", "shift_nm", "unevenness"]

Change = Callable[[dict[str, Any]], None]


def reference(picture: CardPicture | None, **other: Any) -> ReferenceFile:
    """A reference of the shipped rig for phosphors."""
    keys: dict[str, Any] = {
        "bench": "simulated dark room with LVF",
        "camera": None,
        "lens": "EF75mm, 75 mm",
        "lamp": "halogen_3000k",
        "grey_card": "grey_card_18",
        "curves": "canon_eos_5d_mark_ii",
        "made": MADE,
        "picture": picture,
        "run": "a-calibration",
    }
    return ReferenceFile(**keys | other)


def unlike_any() -> CardPicture:
    """A picture as no bench shows it."""
    return CardPicture(
        strip=STRIP, iso=100, f_number=4, channels=("R", "G", "B"), wavelength_nm=NM,
        rate_dn_per_s=((1000.0, 1000.0, 1000.0),) * len(NM), width=WIDTH,
    )  # fmt: skip


def kept(runs: Path, file: ReferenceFile, name: str = "a-calibration") -> Path:
    """Keep a calibration beside the runs in a folder."""
    folder = runs / "calibrations" / name
    folder.mkdir(parents=True)
    REFERENCE_KIND.write(folder, file)
    IRRADIANCE_KIND.write(folder, true_irradiance(WIDTH, HEIGHT))
    FADE_KIND.write(folder, FADE)
    return folder


def checked(folder: Path, file: ReferenceFile, change: Change = lambda rig: None) -> Path:
    """A run of the check against a reference, on a bench as `change` leaves it."""
    kept(folder / "runs", file)
    REFERENCE_KIND.write(folder, file)  # another one makes another recording

    def small(rig: dict[str, Any]) -> None:
        rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}
        change(rig)

    return record(folder, CHECK, small)


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> CardPicture:
    """The card through the filter on the bench as it is calibrated."""

    def only_warn(rig: dict[str, Any]) -> None:
        rig["calibrations"] = {"only_warn": ALL_RULES}
        rig["devices"]["lamp"]["warm_up"] = "20 min"  # other noise in the same room

    run = checked(tmp_path_factory.mktemp("calibrated"), reference(unlike_any()), only_warn)
    frame = read_hdr_frame(read_run(run).frames("check-card"))
    strip = find_strip(frame).strip(rising=True)
    rates = place_means(strip_profile(frame, strip), len(NM))
    return unlike_any().model_copy(
        update={"strip": strip, "rate_dn_per_s": tuple(map(tuple, rates.tolist()))}
    )


def test_a_bench_that_has_not_changed_is_confirmed(picture: CardPicture, tmp_path: Path) -> None:
    run = checked(tmp_path, reference(picture))
    result = process_run(run)
    assert isinstance(result, CalibrationCheckResult)
    change = result.change
    assert change.brightness.value == pytest.approx(1, abs=3 * change.brightness.sigma)
    assert change.colour.value == pytest.approx(1, abs=4 * change.colour.sigma)
    assert change.colour.sigma < 0.01
    assert abs(change.shift_nm.value) < 2
    assert not result.warnings
    found = read_quickly((run / CALIBRATIONS_FILE).read_text())
    assert set(found) == {"fade", "irradiance", "reference"}
    assert Path(found["irradiance"]["file"]).is_file()
    assert "Age when the run began" in (run / "result" / "report.html").read_text()


def other_lens(rig: dict[str, Any]) -> None:
    rig["simulation"]["lens"] = {"name": "EF50mm", "focal_mm": 50}


def dimmer(rig: dict[str, Any]) -> None:
    rig["simulation"]["lamp"] = {"irradiance": 3.5}


def other_card(rig: dict[str, Any]) -> None:
    rig["simulation"]["grey_card"] = 0.5


def aged(rig: dict[str, Any]) -> None:
    # 60 K in three hours.
    rig["simulation"]["lamp"] = {"cooling_per_hour": 20}
    rig["devices"]["lamp"]["warm_up"] = "3 h"


def moved(rig: dict[str, Any]) -> None:
    rig["simulation"]["lvf"]["before_camera"]["region"] = [0.08, 0.28, 0.88, 0.4]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (dimmer, "times as bright as when it was calibrated: the lamp aged"),
        (other_card, "this is another card"),
        pytest.param(
            aged, "the lamp is redder than when it was calibrated", marks=pytest.mark.campaign
        ),
        (moved, "nm from its place before the camera"),
    ],
)
def test_a_bench_that_has_changed_is_refused_in_one_line(
    change: Change, said: str, picture: CardPicture, tmp_path: Path
) -> None:
    with pytest.raises(DataError) as caught:
        checked(tmp_path, reference(picture), change)
    refusal = str(caught.value)
    assert said in refusal
    assert "calibrate anew (labrig run calibration)" in refusal
    assert "\n" not in refusal


def test_another_lens_is_refused_by_the_first_frame_of_any_run(tmp_path: Path) -> None:
    kept(tmp_path / "runs", reference(None, camera=None))
    decay = {"protocol": "decay", "sample": {"name": "with another lens"}}
    with pytest.raises(ProtocolError) as caught:
        record(tmp_path, decay, other_lens)
    said = "expected the calibrated lens, EF75mm, 75 mm, got EF50mm, 50 mm; calibrate the bench"
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    (run,) = (tmp_path / "runs").glob("2026*")
    assert len(list((run / "frames").iterdir())) == 1


def test_another_camera_is_refused_before_anything_is_lit(
    picture: CardPicture, tmp_path: Path
) -> None:
    another = reference(picture, camera="Canon EOS 5D Mark II, serial 7, firmware 2.1.2")
    with pytest.raises(ProtocolError, match="expected the calibrated camera, Canon EOS 5D Mark II"):
        checked(tmp_path, another)
    assert not list((tmp_path / "runs").glob("2026*"))  # nothing was recorded


def test_what_the_rig_file_says_is_only_a_warning(picture: CardPicture, tmp_path: Path) -> None:
    def change(rig: dict[str, Any]) -> None:
        dimmer(rig)
        rig["calibrations"] = {"only_warn": ["brightness"]}

    (warning,) = process_run(checked(tmp_path, reference(picture), change)).warnings
    assert warning.code == "card-brightness-changed"


@pytest.fixture
def rig() -> RigFile:
    return read_rig_file(resources.find("config", "rig", "sim-phosphor"))


def test_the_newest_of_this_bench_is_found_and_what_is_named_goes_before(
    rig: RigFile, tmp_path: Path
) -> None:
    kept(tmp_path, reference(None), "older")
    newer = kept(tmp_path, reference(None, made=MADE + timedelta(days=1)), "newer")
    kept(tmp_path, reference(None, bench="another", made=MADE + timedelta(days=9)), "others")
    mine = rig.optics.model_copy(update={"fade": "my-fade.yaml"})
    now_s = (MADE + timedelta(days=3)).timestamp()
    found = find_calibrations(rig.model_copy(update={"optics": mine}), [tmp_path], now_s)
    assert found.rig.optics.named(IRRADIANCE_KIND) == str(newer / "irradiance.yaml")
    assert found.rig.optics.named(FADE_KIND) == "my-fade.yaml"
    assert found.record(now_s)["irradiance"]["age"] == "48 h"
    (note,) = found.notes
    assert note.startswith("irradiance of the calibration newer, 48 h old")


@pytest.mark.parametrize(
    ("protocol", "shipped"),
    [
        ("colour_check", "sim-phosphor"),
        ("led_fluorescence", "sim-fluorescent"),
        ("led_brightness", "sim-fluorescent"),
        ("emission_spectrum", "sim-phosphor"),
        ("reflectance", "sim-phosphor"),
        ("decay", "sim-phosphor"),
    ],
)
@pytest.mark.parametrize("beside", ["runs", "bench"])
def test_every_protocol_finds_what_lies_beside_the_runs_or_the_rig_file(
    protocol: str, shipped: str, beside: str, tmp_path: Path
) -> None:
    path = resources.find("config", "rig", shipped)
    mine = tmp_path / "bench" / "rig.yaml"
    mine.parent.mkdir()
    written_rig = read_quickly(path.read_text())
    written_rig["simulation"]["epoch"] = "2026-01-02T00:00:00Z"
    if "initial" in written_rig["simulation"]:
        written_rig["simulation"]["initial"] = {"lamp": "off"}
    mine.write_text(write_quickly(written_rig))
    rig = read_rig_file(mine)
    kept(
        tmp_path / beside,
        reference(
            None, bench=rig.name, lamp=rig.optics.lamp, grey_card=rig.optics.grey_card,
            curves=rig.optics.camera,
        ),
    )  # fmt: skip
    recording = Recording.prepare(
        resources.find("protocols", "protocol", protocol), mine, tmp_path / "runs"
    )
    assert set(recording.found.kept) == {"fade", "irradiance", "reference"}
    assert any(note.startswith("fade, irradiance of the calibration") for note in recording.notes())


def test_leds_that_were_calibrated_beside_a_run_are_found_by_it(tmp_path: Path) -> None:
    """A run of led_brightness, processed, and one of led_fluorescence after it."""
    calibrated = record_leds(tmp_path, LEDS)
    process_run(calibrated)
    (one,) = kept_calibrations(tmp_path / "runs")
    assert one.reference.bench == "simulated dark room with LEDs"
    recording = Recording.prepare(
        resources.find("protocols", "protocol", "led_fluorescence"),
        tmp_path / "rig.yaml",
        tmp_path / "runs",
    )
    assert recording.rig.optics.named(LEDS_KIND) == str(one.files()["leds"])
    assert any(note.startswith("leds of the calibration") for note in recording.notes())
    # There is no picture to compare the bench with.
    assert not any("calibration_check" in note for note in recording.notes())
    again = Recording.prepare(tmp_path / "protocol.yaml", tmp_path / "rig.yaml", tmp_path / "runs")
    assert LEDS_KIND.name not in again.found.kept  # it is measured anew


def test_the_picture_is_that_of_the_filter_that_is_found(rig: RigFile, tmp_path: Path) -> None:
    older = kept(tmp_path, reference(None), "with-filter")
    (older / "lvf.yaml").write_text("read later")
    kept(tmp_path, reference(None, made=MADE + timedelta(days=1)), "fade-anew")
    found = find_calibrations(rig, [tmp_path], MADE.timestamp()).kept
    assert {name: each.folder.name for name, each in found.items()} == {
        "fade": "fade-anew", "irradiance": "fade-anew", "lvf": "with-filter",
        "reference": "with-filter",
    }  # fmt: skip


@pytest.mark.parametrize("key", ["lamp", "grey_card", "curves"])
def test_one_with_other_light_is_not_used(key: str, rig: RigFile, tmp_path: Path) -> None:
    kept(tmp_path, reference(None, **{key: "another"}))
    found = find_calibrations(rig, [tmp_path], MADE.timestamp())
    assert found.rig == rig
    (note,) = found.notes
    assert "is not used" in note
    assert "was another, now it is" in note


def test_an_old_one_is_warned_of_or_as_the_rig_file_says_not_used(
    rig: RigFile, tmp_path: Path
) -> None:
    kept(tmp_path, reference(None))
    now_s = (MADE + timedelta(days=31)).timestamp()
    found = find_calibrations(rig, [tmp_path], now_s)
    assert found.rig.optics.named(IRRADIANCE_KIND) is not None
    assert "744 h old, more than 720 h: make another one soon" in found.notes[-1]
    strict = rig.model_copy(update={"calibrations": CalibrationRules(only_warn=())})
    found = find_calibrations(strict, [tmp_path], now_s)
    assert found.rig == strict
    assert "it is 744 h old, more than 720 h" in found.notes[0]


@pytest.mark.parametrize("name", ["reference.yaml", "irradiance.yaml"])
def test_a_corrupt_file_is_one_clear_line(name: str, tmp_path: Path) -> None:
    folder = kept(tmp_path, reference(None))
    (folder / name).write_text("kind: [")
    decay = resources.find("protocols", "protocol", "decay")
    shipped = resources.find("config", "rig", "sim-phosphor")
    with pytest.raises(UsageError) as caught:
        Recording.prepare(decay, shipped, tmp_path)
    assert str(folder / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_corrupt_file_does_not_stop_what_measures_it_anew(tmp_path: Path) -> None:
    (kept(tmp_path, reference(None)) / "irradiance.yaml").write_text("kind: [")
    anew = resources.find("protocols", "protocol", "calibration")
    shipped = resources.find("config", "rig", "sim-phosphor")
    assert Recording.prepare(anew, shipped, tmp_path).found.kept == {}


def test_a_phosphor_on_a_calibrated_bench_is_the_sample_alone(tmp_path: Path) -> None:
    folder = kept(tmp_path, reference(unlike_any()))
    protocol = resources.find("protocols", "protocol", "phosphor")
    shipped = resources.find("config", "rig", "sim-phosphor")
    prepared = Recording.prepare(protocol, shipped, tmp_path).protocol
    assert isinstance(prepared, Phosphor)
    parts = [part["protocol"] for part in prepared.parts]
    assert parts == [
        "calibration_check", "camera_calibration", "blank", "lvf_calibration",
        "emission_spectrum", "decay", "excitation",
    ]  # fmt: skip
    for name in ("camera", "blank", "lvf"):
        (folder / f"{name}.yaml").write_text("read later")
    rig = read_rig_file(shipped)
    found = find_calibrations(rig, [tmp_path], MADE.timestamp()).rig
    chain = read_protocol(protocol).resolved_for(found)
    assert isinstance(chain, Phosphor)
    assert [part["protocol"] for part in chain.parts] == [
        "calibration_check", "emission_spectrum", "decay", "excitation"
    ]  # fmt: skip
    units = [unit.name for unit in chain.units()]
    assert units[:2] == ["calibration_check/card", "emission_spectrum/white"]
    assert units[-2:] == ["decay/meter", "decay/decay-1"]
    REFERENCE_KIND.write(folder, reference(None))
    without_check = read_protocol(protocol).resolved_for(found)
    assert next(unit.name for unit in without_check.units()) == "emission_spectrum/dark"
    always = read_protocol(protocol, {"calibrate": "always"}).resolved_for(found)
    assert isinstance(always, Phosphor)
    assert len(always.parts) == 8


def test_a_camera_without_a_flat_field_at_the_aperture_is_not_used(
    rig: RigFile, tmp_path: Path
) -> None:
    folder = kept(tmp_path, reference(None))
    flat = CameraFile(
        camera="a camera", iso=100, f_number=4, channels=("L",), flicker=0.01, flicker_sigma=0.001,
        flats=(Flat(f_number=4, falloff=((-0.1,),)),),
    )  # fmt: skip
    CAMERA_KIND.write(folder, flat)
    found = find_calibrations(rig, [tmp_path], MADE.timestamp())
    assert found.without_apertures([4.0]) is found
    assert found.rig.optics.named(CAMERA_KIND) is not None
    stopped_down = found.without_apertures([4.0, 5.6])
    assert stopped_down.rig.optics.named(CAMERA_KIND) is None
    assert stopped_down.rig.optics.named(FADE_KIND) is not None
    assert "no flat field at f/5.6" in stopped_down.notes[-1]
    parts = [{"protocol": "decay", "camera": {"iso": 100, "f_number": 8}}, {"protocol": "fade"}]
    chain = written(tmp_path, protocol="phosphor", parts=parts)
    assert read_protocol(chain).apertures() == {8.0, 4.0}


def test_without_a_calibration_there_is_nothing_to_check(rig: RigFile, tmp_path: Path) -> None:
    path = tmp_path / "check.yaml"
    path.write_text(write_quickly(CHECK))
    with pytest.raises(UsageError, match="expected a calibration to check, found none"):
        read_protocol(path).resolved_for(rig)


def test_only_a_calibration_is_kept(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "a-run"
    (run / "result" / "fade").mkdir(parents=True)
    FADE_KIND.write(run / "result" / "fade", FADE)
    assert keep_calibration(run) is None
    REFERENCE_KIND.write(run / "result", reference(None))
    for _ in range(2):  # processed again it takes the place of the earlier one
        assert keep_calibration(run) == run.parent / "calibrations" / "a-run"
    (one,) = kept_calibrations(run.parent)
    assert set(one.files()) == {"fade", "reference"}


def test_sigmas_of_a_change_are_those_of_the_noise() -> None:
    """Flicker of both pictures, and noise of each place, on a change that the fit has exactly."""
    rng, pulls = np.random.default_rng(7), []
    nm, before = np.array(NM), np.full((31, 1), 1000.0)
    z = (1 / nm - 1 / 550) / (1 / 420 - 1 / 680)
    for _ in range(400):
        noise = rng.normal(0, 0.01, 31)
        flicker = rng.normal(0, 0.005, 2)
        now = before * 0.97 * np.exp(0.02 * z + noise + flicker[0])[:, None]
        change = compare_card_pictures(nm, before * np.exp(flicker[1]), now, (STRIP, STRIP), 400)
        pulls.append((np.log(change.colour.value) - 0.02) / change.colour.sigma)
    assert 0.85 < np.std(pulls) < 1.18
