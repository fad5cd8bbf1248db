"""The fade and rise of the simulated lamp, a filament whose heat capacity changes as it cools."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.acquire import PlanClock, RunObserver
from labrig.analyse import Overrides
from labrig.calibration import FADE_KIND, Change, FadeFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.clock import Clock
from labrig.foundation.errors import UsageError
from labrig.process import Processed, process_run
from labrig.protocols.fade.result import FadeResult
from labrig.record import read_run
from labrig.sim.lamp import WAVELENGTH_NM, Lamp
from labrig.sim.simulation import LampSettings
from tests.acquire.fakes import Watching
from tests.analyse.recorded import cut_off_and_resumed, processed_once, record
from tests.analyse.small_runs import FADE
from tests.results.made import assert_read_back
from tests.warned import codes

#: Of a photograph, relative.
FLICKER = 0.007


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("fade"), FADE)


@pytest.fixture(scope="module")
def processed(run: Path) -> Processed:
    return processed_once(run)


@pytest.fixture(scope="module")
def result(processed: Processed) -> Any:
    return processed.result


@pytest.fixture(scope="module")
def fade(result: FadeResult) -> FadeFile:
    return result.calibration


def true_fractions(file: FadeFile, change: Change, *, rises: bool) -> FloatArray:
    lamp = Lamp.found(LampSettings(warm_up_deficit=0, drift_per_hour=0), on=not rises)
    steady = Lamp.found(lamp.settings, on=True).irradiance(0.0)
    switched = lamp.switched(rises, 10.0)
    light = np.array([switched.irradiance(10.0 + t_s) for t_s in change.t_s])
    edges = np.array(file.bands_nm)
    inside = (edges[:-1, None] < WAVELENGTH_NM) & (edges[1:, None] > WAVELENGTH_NM)
    fractions: FloatArray = (light @ inside.T) / (inside @ steady)
    return fractions


def test_the_fade_is_the_lamps_in_every_band(fade: FadeFile) -> None:
    true = true_fractions(fade, fade.fade, rises=False)
    fraction, sigma = np.array(fade.fade.fraction), np.array(fade.fade.sigma)
    assert np.abs(fraction - true).max() < 0.06
    assert np.all(np.abs(fraction - true) < 3 * sigma + 1e-3)
    steps = np.diff(fade.fade.t_s)
    missing = steps @ (true[1:] + true[:-1]) / 2
    assert fade.fade.equivalent_s() == pytest.approx(missing, abs=5e-3)
    # The blue goes first.
    assert np.all(np.diff(fade.fade.equivalent_s()) > 0)


def test_the_rise_is_the_lamps_in_every_band(fade: FadeFile) -> None:
    assert fade.rise is not None
    true = true_fractions(fade, fade.rise, rises=True)
    fraction, sigma = np.array(fade.rise.fraction), np.array(fade.rise.sigma)
    assert np.all(np.abs(fraction - true) < 3 * sigma + 1e-3)
    assert np.abs(fraction - true).max() < 0.03


def test_it_is_a_glowing_bodys(result: FadeResult) -> None:
    assert result.warnings == ()
    assert result.fade.best.name == "filament"
    assert result.rise is not None
    assert result.rise.best.name == "filament"
    assert sum(shape.weight for shape in result.rise.shapes) == pytest.approx(1)
    for change in (result.fade, result.rise):
        assert abs(change.exponent.value - 1) < max(0.03, 4 * change.exponent.sigma)
        assert abs(change.lag.value) < 0.01
        assert change.best.reduced_chi2 < 2


@pytest.mark.campaign
def test_with_the_curves_of_another_camera_it_still_is(tmp_path: Path) -> None:
    """The blue of this seed's sensor sees a little of the red, where the curves have nothing."""

    def other_camera(rig: dict[str, Any]) -> None:
        rig["simulation"]["seed"] = 2

    protocol = FADE | {"warming": False, "rise": False}
    result: Any = process_run(record(tmp_path, protocol, other_camera))
    assert result.warnings == ()
    assert result.fade.best.name == "filament"
    true = true_fractions(result.calibration, result.calibration.fade, rises=False)
    fraction, sigma = (
        np.array(rows) for rows in (result.calibration.fade.fraction, result.calibration.fade.sigma)
    )
    assert np.all(np.abs(fraction - true) < 3 * sigma + 1e-3)


@pytest.mark.campaign
def test_what_glows_after_the_lamp_is_no_glowing_bodys(tmp_path: Path) -> None:
    """A hundredth of a per cent that fades within a minute, as of a lamp's phosphor."""

    def afterglow(rig: dict[str, Any]) -> None:
        rig["simulation"]["lamp"] = {"afterglow": "0.01 %", "afterglow_fades": "60 s"}

    protocol = FADE | {"warming": False, "rise": False, "every": "80 ms"}
    result: Any = process_run(record(tmp_path, protocol, afterglow))
    assert "lamp-not-glowing-body" in codes(result.warnings)


def test_the_light_of_a_frame_has_all_that_scatters_from_one_to_the_next(
    result: FadeResult,
) -> None:
    """Frames of the nearly steady lamp have its flicker, those of its rise the shutter's jitter."""
    assert result.rise is not None
    frames = result.rise.frames
    relative = frames.light_sigma_s / frames.light_s
    steady = frames.light_s > 0.95 * frames.exposure_s[:, np.newaxis]
    of_flicker = np.hypot(FLICKER, FLICKER / np.sqrt(frames.steady_frames[0]))
    assert relative[steady] == pytest.approx(of_flicker, rel=0.15)
    table = result.calibration.rise
    assert table is not None
    green = np.array(table.fraction)[:, 7]
    begin_s = frames.start_s + result.rise.lag.value
    ends = [np.interp(t_s, table.t_s, green) for t_s in (begin_s, begin_s + frames.exposure_s)]
    by_jitter = result.rise.best.jitter_s * (ends[1] - ends[0]) / frames.light_s[:, 1]
    assert by_jitter.max() > 4 * FLICKER
    assert relative[:, 1] == pytest.approx(np.hypot(of_flicker, by_jitter), rel=0.15)


def test_a_person_is_reported(processed: Processed) -> None:
    told = ("the turn-off transient is", "the turn-on transient lacks", "a cold lamp has")
    lines = [line for line in processed.lines if not line.startswith("budget of ")]
    for line, begin in zip(lines, told, strict=True):
        assert line.startswith(begin)


def test_the_result_and_its_file_are_read_back(run: Path, result: FadeResult) -> None:
    assert FADE_KIND.read(run / "result" / "fade.yaml") == result.calibration
    assert_read_back(result)


@pytest.mark.campaign
def test_killed_within_a_pass_it_goes_on_there(run: Path, result: FadeResult) -> None:
    units = list(read_run(run).completed())
    cut, resumed = cut_off_and_resumed(run, "pass-2")
    assert list(cut.completed()) == units[:-3]
    assert list(resumed.completed()) == units


def test_without_the_lamps_spectrum_it_says_what_is_missing(run: Path, result: FadeResult) -> None:
    path = run / "rig.yaml"
    path.write_text(path.read_text().replace("lamp: halogen_3000k\n", "lamp: null\n"))
    with pytest.raises(UsageError, match="which lamp it has"):
        process_run(run, Overrides(edited=True))


def test_what_a_cold_lamp_lacks_is_the_rooms(fade: FadeFile, result: FadeResult) -> None:
    """The room's lamp lacks 3 % and warms in 150 s."""
    assert fade.warming is not None
    assert abs(fade.warming.deficit - 0.03) < 3 * fade.warming.deficit_sigma
    assert fade.warming.deficit_sigma < 0.006
    assert 50 < fade.warming.time_constant_s < 450
    assert result.warming is not None
    assert result.warming.light[-1] == pytest.approx(1, abs=0.03)


class Busy(Watching):
    """A PC that does something else once, just when it should release the shutter."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock, self._busy = clock, False

    def doing(self, what: str, until_s: float | None = None) -> None:
        """Be late for the second photograph of the rise."""
        super().doing(what, until_s)
        if not self._busy and self.told.count("kept rise") == 1 and what == "lamp on":
            self._busy = True
            self._clock.sleep(1.0)


def test_what_began_late_is_photographed_again(run: Path, tmp_path: Path) -> None:
    @contextmanager
    def busy(plan_clock: PlanClock, clock: Clock) -> Iterator[RunObserver]:
        yield Busy(clock)

    again = read_run(record(tmp_path, FADE | {"warming": False}, watch=busy))
    counts = [
        len([frame for frame in one.frames("rise") if frame.unit == "pass-1"])
        for one in (read_run(run), again)
    ]
    assert counts[1] == counts[0] + 1
    assert max(frame.late_s for frame in again.frames("rise")) > 0.5
