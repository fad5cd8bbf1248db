"""Mercury instead of halogen, filters before them, afterglow behind them, light from elsewhere."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.sim.faults import FaultTime
from labrig.sim.filters import Filters, read_curve
from labrig.sim.lamp import (
    BURNING_K,
    BURNING_LIGHT,
    CELL_NM,
    IS_VISIBLE,
    LINES,
    SETTLED_S,
    WAVELENGTH_NM,
    Lamp,
    Mercury,
    filament_spectrum,
    line_spectrum,
)
from labrig.sim.lamps import FilteredLamps
from labrig.sim.lights import Lights, leak
from labrig.sim.simulation import LampSettings
from tests.sim.darkroom import Darkroom

SHIPPED = Filters(None, 0.0, 1)
CLEAR = np.ones_like(WAVELENGTH_NM)
COLD = Lamp.found(LampSettings(), on=False)


def test_mercury_lines_keep_light_and_centroid() -> None:
    spectrum = line_spectrum() - line_spectrum().min()
    for line_nm in (435.8335, 546.0750):
        near = np.abs(WAVELENGTH_NM - line_nm) < 2 * CELL_NM
        strength = dict(LINES)[line_nm]
        assert CELL_NM * spectrum[near].sum() == pytest.approx(40 * strength)
        centroid = np.average(WAVELENGTH_NM[near], weights=spectrum[near])
        assert centroid == pytest.approx(line_nm, abs=1e-9)
    between = (WAVELENGTH_NM > 450) & (WAVELENGTH_NM < 530)
    assert not spectrum[between].any()


def test_the_arc_warms_and_its_light_adds_up() -> None:
    lamp = Mercury().switched(True, 10.0).switched(False, 200.0).switched(True, 300.0)
    at = int(line_spectrum().argmax())
    gains = [lamp.irradiance(t)[at] / line_spectrum()[at] for t in (9.0, 10.0, 55.0, 199.9, 250.0)]
    assert gains == pytest.approx([0.0, 0.4, 1 - 0.6 / np.e, 0.991, 0.0], abs=1e-3)
    spans = ((5.0, 10.0), (10.0, 200.0), (200.0, 300.0), (300.0, 310.0))
    expected = sum(quad(lambda t: lamp.irradiance(t)[at], *span)[0] for span in spans)
    assert lamp.exposure(5.0, 310.0)[at] == pytest.approx(expected, rel=1e-7)
    assert (lamp.dark(0.0, 9.0), lamp.dark(5.0, 11.0), lamp.dark(210.0, 290.0)) == (
        True, False, True,
    )  # fmt: skip
    assert lamp.until(250.0).last_switch_off(400.0) == 200.0


def test_a_filter_takes_its_part_from_when_it_is_there() -> None:
    half, red = 0.5 * CLEAR, SHIPPED.transmission("longpass-570")
    lamps = FilteredLamps(
        Lamp.found(LampSettings(), on=True), Mercury(), ((0.0, CLEAR), (10.0, half), (20.0, red))
    )
    bare = Lamp.found(LampSettings(), on=True)
    spans = ((5.0, 10.0, CLEAR), (10.0, 20.0, half), (20.0, 30.0, red))
    expected = sum(passed * bare.exposure(left, right) for left, right, passed in spans)
    assert lamps.exposure(5.0, 30.0) == pytest.approx(expected)
    assert lamps.irradiance(15.0) == pytest.approx(half * bare.irradiance(15.0))
    assert lamps.corners(5.0, 30.0) == [10.0, 20.0]


def test_the_relay_feeds_the_lamp_that_hands_have_put_there() -> None:
    bench = Darkroom(door={}, faults=[{"mercury_dead": {"at": "100 s"}}])
    bench.do("grey card", "lamp mercury")
    bench.room.switch_lamp(True)
    bench.clock.spend(10.0)
    green_and_blue = bench.shoot(1 / 30, 100)
    assert 300 < green_and_blue.mean() < 10_000
    bench.do("lamp halogen")
    bench.clock.spend(20.0)
    halogen = bench.shoot(1 / 60, 100)
    assert halogen.mean() > 1000
    bench.do("lamp mercury")
    bench.clock.spend(100.0)
    assert bench.room.lamp_on, "it has current"
    assert bench.shoot(1 / 60, 100).mean() == pytest.approx(0, abs=2), "but no arc"
    bench.do("lamp halogen")
    bench.clock.spend(20.0)
    assert bench.shoot(1 / 60, 100) == pytest.approx(halogen, rel=0.5, abs=300)


def test_a_lamp_further_away_gives_less_by_the_square() -> None:
    bench = Darkroom(initial={"lamp": "on"})
    bench.clock.spend(1.0)
    bench.do("grey card")
    near = bench.shoot(1 / 60, 100).mean()
    bench.do("lamp at 2 m")
    far = bench.shoot(1 / 60, 100).mean()
    bench.do("lamp back")
    assert far == pytest.approx(near / 4, rel=0.01)
    assert bench.shoot(1 / 60, 100).mean() == pytest.approx(near, rel=0.01)


def test_afterglow_stays_when_the_filament_is_dark_and_fades() -> None:
    settings = LampSettings.model_validate(
        {"afterglow": 1e-4, "afterglow_fades": "20 s", "drift_per_hour": 0}
    )
    lamp = Lamp.found(settings, on=True).switched(False, 10.0)
    full = filament_spectrum(BURNING_K)
    for after_s in (SETTLED_S, 30.0):
        left = lamp.irradiance(10.0 + after_s)
        assert left == pytest.approx(1e-4 * np.exp(-after_s / 20.0) * full, rel=1e-6)
    assert not lamp.dark(20.0, 30.0)
    total = lamp.exposure(15.0, 1e3)[80]
    assert total == pytest.approx(full[80] * 1e-4 * 20.0 * np.exp(-5 / 20.0), rel=1e-3)
    assert lamp.exposure(40.0, 41.0)[80] == pytest.approx(lamp.irradiance(40.5)[80], rel=1e-3)


def test_the_shield_keeps_afterglow_away() -> None:
    bench = Darkroom(lamp={"afterglow": 1e-3}, initial={"lamp": "on"}, shield={"channel": 1})
    bench.clock.spend(1.0)
    bench.room.switch_lamp(False)
    bench.do("blank")
    bench.clock.spend(5.0)
    seen = bench.shoot(1.0)[20:44].mean()
    bench.swing(1000e-6)
    hidden = bench.shoot(1.0)[20:44].mean()
    assert seen > 300
    assert hidden == pytest.approx(0, abs=1)


def test_what_leaks_in_is_there_while_it_lasts() -> None:
    lights = Lights(
        COLD, leaks=[leak(1e-5, [FaultTime.model_validate({"at": "5 s", "for": "10 s"})])]
    )
    assert lights.corners(4.0, 20.0) == [5.0, 15.0]
    assert [lights.irradiance(t).any() for t in (4.0, 6.0, 16.0)] == [False, True, False]
    assert lights.irradiance(6.0).sum() == pytest.approx(1e-5 * BURNING_LIGHT)
    assert (lights.dark(4.0, 5.0), lights.dark(4.0, 6.0), lights.dark(15.0, 20.0)) == (
        True, False, True,
    )  # fmt: skip
    assert lights.exposure(0.0, 20.0) == pytest.approx(10.0 * lights.irradiance(6.0))


def test_ambient_light_comes_and_goes_and_a_leak_stays() -> None:
    leaking = Darkroom(ambient=1e-5)
    fault = {"ambient_light": {"at": "5 s", "for": "10 s", "level": 1e-5}}
    passing = Darkroom(faults=[fault])
    seen = []
    for bench in (leaking, passing):
        bench.do("blank")
        for at_s in (1.0, 8.0, 20.0):
            bench.clock.spend(at_s - bench.clock.now())
            seen.append(bench.shoot(1.0)[20:44].mean())
    assert seen[:3] == pytest.approx([seen[0]] * 3, rel=0.05)
    assert 10 < seen[0] < 500
    assert seen[3:] == pytest.approx([0.0, seen[0], 0.0], rel=0.05, abs=1)


def test_shipped_filters_are_many_and_different() -> None:
    names = sorted(path.stem for path in resources.folder("config/optics/filters").glob("*.csv"))
    curves = np.array([SHIPPED.transmission(name) for name in names])
    assert len(names) >= 40
    assert curves.min() >= 0
    assert curves.max() < 1
    visible = (WAVELENGTH_NM > 400) & (WAVELENGTH_NM < 700)
    for one, other in pairwise(range(len(names))):
        assert np.abs(curves[one] - curves[other])[visible].max() > 0.05, names[one]
    assert np.linalg.matrix_rank(curves[:, visible], tol=0.02) > 20


def test_true_filters_are_bent_smoothly_and_the_same_each_time() -> None:
    bent, again = Filters(None, 0.02, 5), Filters(None, 0.02, 5)
    for name in ("longpass-570", "neutral-50"):
        true, file = bent.transmission(name), SHIPPED.transmission(name)
        ratio = true / file - 1
        assert np.sqrt(np.mean(ratio[IS_VISIBLE] ** 2)) == pytest.approx(0.02, rel=1e-6)
        assert np.abs(np.diff(ratio)).max() < 0.01
        assert np.array_equal(true, again.transmission(name))
    assert not np.array_equal(
        Filters(None, 0.02, 6).transmission("neutral-50"), bent.transmission("neutral-50")
    )


def test_filters_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_text("# my filter\n400,0.2\n700,0.8\n")
    own = Filters(str(tmp_path), 0.0, 1).transmission("own")
    assert np.interp(550, WAVELENGTH_NM, own) == pytest.approx(0.5)
    assert own[0] == pytest.approx(0.2)
    (tmp_path / "own.csv").write_text("wavelength_nm,value\n400,a lot\n")
    with pytest.raises(UsageError, match="expected wavelength_nm and a value in two columns"):
        read_curve(tmp_path / "own.csv")
    (tmp_path / "own.csv").unlink()
    with pytest.raises(UsageError, match="file for each colour filter, got none"):
        Filters(str(tmp_path), 0.0, 1)
    with pytest.raises(UsageError, match="expected a folder of colour filters"):
        Filters(str(tmp_path / "none"), 0.0, 1)


def test_the_lamp_and_card_that_are_shipped_are_those_of_the_room() -> None:
    """Written by hand from the same law; the card is not quite the simulated one."""
    folder = resources.folder("config/optics")
    lamp = read_curve(folder / "halogen_3000k.csv")
    expected = filament_spectrum(BURNING_K)[IS_VISIBLE]
    assert lamp[IS_VISIBLE] == pytest.approx(expected, rel=2e-3)
    assert read_curve(folder / "grey_card_18.csv")[IS_VISIBLE] == pytest.approx(0.18, rel=0.05)
