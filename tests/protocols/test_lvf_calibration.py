"""The LVF's calibration: its timeline, what it refuses, and what it finds in the simulated room."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from labrig.acquire import (
    ManualStep,
    PlanClock,
    RunObserver,
    plan,
    read_protocol,
    read_rig_file,
)
from labrig.bench import Recording, resume_run
from labrig.calibration import IRRADIANCE_KIND, LVF_KIND
from labrig.foundation import resources
from labrig.foundation.clock import Clock, Interrupted
from labrig.foundation.errors import UsageError
from labrig.process import process_run
from labrig.protocols.lvf_calibration.result import LvfCalibrationResult
from labrig.record import read_run
from labrig.results import read_result
from tests.acquire.fakes import Watching
from tests.analyse.lvf_calibration.room_truth import (
    FINE_NM,
    bands_of,
    simulation_of,
    true_bands,
    true_irradiance,
)
from tests.conftest import Ended
from tests.quick_yaml import read_quickly, write_quickly
from tests.results.made import assert_read_back

Make = Callable[..., Path]
Labrig = Callable[..., Ended]

GOLDEN = Path(__file__).parent
FEW = (
    "longpass-440", "longpass-490", "longpass-540", "longpass-600",
    "shortpass-430", "shortpass-520", "shortpass-585", "shortpass-655",
)  # fmt: skip


@pytest.fixture
def write(tmp_path: Path) -> Make:
    """Writes a short calibration protocol, changed as told."""

    def make(protocol: str = "lvf_calibration", **keys: object) -> Path:
        content: dict[str, object] = {"protocol": protocol, "repeats": 1, "longest": "4 s"}
        if protocol == "irradiance":
            content |= {"rounds": 1}
        else:
            content |= {"filters": list(FEW), "stripes": "2 min", "rising": True}
        path = tmp_path / f"{protocol}.yaml"
        path.write_text(write_quickly(content | keys))
        return path

    return make


@pytest.mark.parametrize("name", ["lvf_calibration", "irradiance"])
def test_the_timeline_is_as_agreed(name: str, write: Make) -> None:
    filters = {"filters": list(FEW[:2])} if name == "lvf_calibration" else {}
    rig = resources.find("config", "rig", "sim-phosphor")
    laid_out = plan(read_protocol(write(name, **filters)), read_rig_file(rig), str(rig))
    golden = GOLDEN / f"{name}.timeline.txt"
    assert "\n".join(laid_out.lines()) + "\n" == golden.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"filters": ["a", "b", "a"]}, "'a' in 'filters' stands twice"),
        ({"filters": ["none"]}, "'none' in 'filters'"),
        ({"filters": ["../a"]}, "filters"),
        ({"stripes": "often"}, "expected none, or a duration"),
        ({"risng": True}, "did you mean 'rising'?"),
        ({"protocol": "irradiance", "bands_nm": [500, 400]}, "rising wavelengths in 'bands_nm'"),
        ({"protocol": "irradiance", "vector_length": 0}, "vector_length"),
    ],
)
def test_a_misspelt_or_impossible_key_is_one_clear_line(
    write: Make, keys: dict[str, object], said: str
) -> None:
    path = write(**keys)
    with pytest.raises(UsageError) as caught:
        read_protocol(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("in_a_chain", [False, True])
def test_all_filters_are_those_that_the_rig_has(
    write: Make, make_rig: Make, tmp_path: Path, in_a_chain: bool
) -> None:
    own = tmp_path / "my filters"
    own.mkdir()
    for name in ("shortpass-585", "longpass-440"):
        table = resources.folder("config/optics/filters") / f"{name}.csv"
        shutil.copy(table, own / f"mine-{name}.csv")
    rig = make_rig(base="sim-phosphor", filters=str(own))
    content = read_quickly(rig.read_text())
    content["optics"]["filters"] = "./my filters"
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig.write_text(write_quickly(content))
    protocol = write(filters="all")
    if in_a_chain:
        parts = [read_quickly(protocol.read_text())]
        protocol.write_text(write_quickly({"protocol": "phosphor", "parts": parts}))
    recording = Recording.prepare(protocol, rig, tmp_path)
    units = [name.split("/")[-1] for name in recording.plan.units]
    filters = [name for name in units if name.startswith("filter-")]
    assert filters == ["filter-none", "filter-mine-longpass-440", "filter-mine-shortpass-585"]
    # What is recorded holds for resume and processing, whatever becomes of the folder.
    recorded = recording.protocol.model_dump(mode="json", by_alias=True)
    (tmp_path / "recorded.yaml").write_text(write_quickly(recorded))
    again = read_protocol(tmp_path / "recorded.yaml")
    assert tuple(unit.name for unit in again.units()) == recording.plan.units
    shutil.rmtree(own)
    with pytest.raises(UsageError, match="expected a table NAME"):
        Recording.prepare(protocol, rig, tmp_path)


class Person(Watching):
    """Does as asked, but for one thing each: leaves at `leaves`, takes a step back at `regrets`."""

    def __init__(self, leaves: str = "", regrets: str = "") -> None:
        super().__init__()
        self._leaves, self._regrets = leaves, regrets

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        self.told.append(f"by hand: {step.what}")
        if self._leaves and self._leaves in step.what:
            raise Interrupted(2)
        if self._regrets and self._regrets in step.what:
            self._regrets = ""
            return None
        return ""

    @contextmanager
    def watch(self, plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
        yield self


@pytest.mark.campaign
def test_stopped_at_a_filter_resumed_and_one_taken_back_it_calibrates_the_strip(
    write: Make, make_rig: Make, labrig: Labrig, tmp_path: Path
) -> None:
    rig = make_rig(base="sim-phosphor")
    recording = Recording.prepare(write(), rig, tmp_path)
    with pytest.raises(Interrupted):
        recording.record(Person(leaves=FEW[3]).watch)
    (folder,) = tmp_path.glob("*_lvf_calibration_*")
    assert f"filter-{FEW[2]}" in read_run(folder).completed()
    later = Person(regrets=FEW[5])
    resume_run(folder, later.watch)
    asked = [text for text in later.told if text.startswith("by hand")]
    # Nobody knows what became of the bench meanwhile: everything is asked for, once.
    assert [text.split()[2] for text in asked[:4]] == ["connect", "lay", "put", "put"]
    assert [FEW[3] in text for text in asked[:5]] == [False] * 3 + [True, False]
    # The filter before the one at which a step was taken back was put in again.
    assert sum(FEW[4] in text for text in asked) == 2
    record = read_run(folder)
    assert len([one for one in record.attempts if one.unit == f"filter-{FEW[4]}"]) == 2
    assert list(record.completed())[-1] == "put-back"

    result = process_run(folder)
    assert isinstance(result, LvfCalibrationResult)
    assert not result.warnings
    file = result.calibration
    assert LVF_KIND.read(folder / "result" / "lvf.yaml") == file
    assert read_result(folder).to_json() == result.to_json()
    assert_read_back(result)
    assert result.filters == tuple(result.through_filters)[1:] == FEW
    assert not [one for one in result.filter_misfits if one.left_out]
    assert np.nanmax(np.abs(result.transmittance_residual)) < 0.1
    assert result.before_camera.lines.wavelength_nm[-1] == pytest.approx(577, abs=0.1)
    assert result.map_rms_nm < 2
    assert result.stripes is not None
    assert abs(result.stripes.shift_nm) < 4 * result.stripes.sigma_nm
    room = simulation_of(folder)
    assert file.before_camera is not None
    assert file.on_sample is not None
    assert (file.before_camera.rising, file.on_sample.rising) == (True, False)
    truth = true_bands(room, file.before_camera)
    drawn = bands_of(file.lvf.transmission(FINE_NM))
    sigma = file.sigma.bands()
    # 3.4 nm a pixel here; tests/acceptance/lvf_in_the_room.py has more of them.
    inside = (truth.centre_nm > 425) & (truth.centre_nm < 670)
    off = np.abs(drawn.centre_nm - truth.centre_nm)
    assert off[inside].max() < 2.5
    assert (off < 4 * sigma.centre_nm + 1.0).all()
    np.testing.assert_allclose(drawn.fwhm_nm[inside], truth.fwhm_nm[inside], rtol=0.15)
    assert sigma.centre_nm[[0, -1]].mean() > 1.2 * sigma.centre_nm[15]
    there = true_bands(room, file.on_sample, on_sample=True)
    at = np.array(file.on_sample.positions(96, 64))
    on_sample = np.interp(at, np.array(file.position), drawn.centre_nm)
    assert np.abs(on_sample - there.centre_nm)[inside].max() < 3.5

    content = read_quickly(rig.read_text())
    content["optics"]["lvf"] = str(folder)
    content["simulation"] |= {"epoch": "2026-01-01T00:00:00Z", "initial": {"lamp": "off"}}
    rig.write_text(write_quickly(content))
    ended = labrig("run", write("irradiance"), "--rig", rig, "--runs", tmp_path, "--yes")
    assert ended.code == 0, ended.err
    light = IRRADIANCE_KIND.read(ended.run_folder / "result" / "irradiance.yaml")
    expected = true_irradiance(room, light.lvf_strip(), light.bands_nm)
    assert np.linalg.norm(light.direct) == pytest.approx(1.0)
    through, spread = np.array(light.through), np.array(light.through_sigma)
    total = through.sum(axis=1) / expected.sum(axis=1) - 1
    assert np.abs(total[inside]).max() < 0.2
    relative = np.array(light.ratio_sigma) / np.array(light.ratio)
    assert (np.abs(total) < 4 * relative + 0.05).all()
    strongest = np.arange(31), through.argmax(axis=1)
    assert (spread[strongest] < 0.5 * through[strongest]).all()


@pytest.mark.parametrize(
    ("fault", "unit", "said"),
    [
        ({"lamp_dead": {}}, "card", "card: dark even in 4 s: the halogen lamp did not light"),
        pytest.param(
            "mercury_dead",
            "lines",
            "lines: dark even in 4 s: the mercury lamp did not light",
            marks=pytest.mark.campaign,
        ),
        ("lvf_turned", "lines", "the strip is the wrong way round"),
    ],
    ids=["lamp", "mercury", "turned"],
)
def test_a_fault_is_one_clear_line_before_the_filters(
    write: Make, make_rig: Make, labrig: Labrig, tmp_path: Path, fault: object, unit: str, said: str
) -> None:
    rig = make_rig(base="sim-phosphor", faults=[fault])
    ended = labrig("run", write(), "--rig", rig, "--runs", tmp_path / "runs", "--yes")
    assert ended.code in (3, 4)
    (line,) = (text for text in ended.err.splitlines() if text.startswith("labrig: "))
    assert said in line
    (folder,) = (tmp_path / "runs").iterdir()
    assert unit not in read_run(folder).completed()


@pytest.mark.campaign
def test_a_filter_that_was_skipped_is_reported_at_once_and_left_out(
    write: Make, make_rig: Make, labrig: Labrig, tmp_path: Path
) -> None:
    rig = make_rig(base="sim-phosphor", faults=[{"filter_skipped": {"name": FEW[3]}}])
    protocol = write(filters=list(FEW[:6]), stripes="none")
    ended = labrig("run", protocol, "--rig", rig, "--runs", tmp_path / "runs", "--yes")
    assert ended.code == 0, ended.err
    told = [text for text in ended.err.splitlines() if "take the last step back" in text]
    assert len(told) == 1
    assert f"colour filter {FEW[3]} is like the one before it (filter-{FEW[2]})" in told[0]
    (left_out,) = (t for t in (ended.out + ended.err).splitlines() if "is left out" in t)
    assert f"colour filter {FEW[3]}" in left_out
    assert f"it looks like {FEW[2]}" in left_out
    assert "5 colour filters" in ended.out + ended.err
