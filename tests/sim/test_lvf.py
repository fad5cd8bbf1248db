"""The LVF: a coloured strip before the camera, bands of glow below it on the sample."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import validate
from labrig.sim.bench_settings import LvfSettings, StripSettings
from labrig.sim.lamp import WAVELENGTH_NM
from labrig.sim.layout import PIECES, Lvf, pieces
from labrig.sim.simulation import Simulation
from tests.sim.darkroom import DOOR, LVF, SMALL, STRIP, Darkroom, colours, columns, mosaic

BENT = LvfSettings(centre=(400, 700), bend_nm=5, fwhm_nm=25, leakage=0.002)
FINE_NM = np.linspace(300, 900, 6001)


def half_maxima(u: float) -> tuple[float, float]:
    """Middle and width of the band at a place."""
    (passed,) = Lvf(BENT).transmission(np.array([u]), FINE_NM) - BENT.leakage
    above = FINE_NM[passed >= passed.max() / 2]
    return (above[0] + above[-1]) / 2, above[-1] - above[0]


@pytest.mark.parametrize(("u", "fwhm_nm"), [(0.0, 23.0), (0.5, 25.0), (1.0, 27.0)])
def test_a_band_is_where_and_as_wide_as_it_is_reported(u: float, fwhm_nm: float) -> None:
    centre_nm, width_nm = half_maxima(u)
    assert centre_nm == pytest.approx(float(Lvf(BENT).centre_nm(np.array([u]))[0]), abs=0.5)
    assert width_nm == pytest.approx(fwhm_nm, rel=0.02)


def test_it_is_no_gaussian_and_leaks() -> None:
    (passed,) = Lvf(BENT).transmission(np.array([0.5]), FINE_NM)
    centre_nm, width_nm = half_maxima(0.5)
    gauss = np.exp(-math.log(2) * (2 * (FINE_NM - centre_nm) / width_nm) ** 2)
    left = (passed - BENT.leakage) / (passed - BENT.leakage).max() - gauss
    assert 0.02 < np.abs(left).max() < 0.06
    assert passed.min() == pytest.approx(BENT.leakage, rel=1e-3)
    away = FINE_NM - centre_nm
    shoulder = passed[np.argmin(np.abs(away - 25))] - passed[np.argmin(np.abs(away + 25))]
    assert shoulder > 0.005


@given(st.floats(-10, 10), st.floats(350, 450), st.floats(600, 750))
def test_the_wavelength_rises_all_the_way(bend_nm: float, blue_nm: float, red_nm: float) -> None:
    lvf = Lvf(LvfSettings(centre=(blue_nm, red_nm), bend_nm=bend_nm))
    u = np.linspace(0, 1, 301)
    centre_nm = lvf.centre_nm(u)
    assert (np.diff(centre_nm) > 0).all()
    assert (centre_nm[0], centre_nm[-1]) == pytest.approx((blue_nm, red_nm))
    off = centre_nm - blue_nm - (red_nm - blue_nm) * u
    assert abs(off[150]) == pytest.approx(abs(bend_nm), abs=1e-9)


def test_a_tilted_strip_lies_along_its_centre_line() -> None:
    strip = StripSettings(region=(0.1, 0.3, 0.8, 0.4), tilt=5.0)
    found = pieces(strip, 960, 640)
    row, column = np.nonzero((found == 1 + PIECES // 4) | (found == 1 + 3 * PIECES // 4))
    left = column < 480
    assert column[left].mean() == pytest.approx(480 - 192 * math.cos(math.radians(5)), abs=1)
    assert row[left].mean() == pytest.approx(320 - 192 * math.sin(math.radians(5)), abs=1)
    assert row[~left].mean() == pytest.approx(320 + 192 * math.sin(math.radians(5)), abs=1)
    assert np.count_nonzero(found) == pytest.approx(768 * 256, rel=0.01)
    straight = pieces(StripSettings(region=(10, 20, 40, 20)), 96, 64)
    assert straight[20:40, 10:50].all()
    assert np.count_nonzero(straight) == 40 * 20


def grey_through_lvf(*tasks: str, **changed: object) -> Darkroom:
    bench = Darkroom(**{"initial": {"lamp": "on"}, "lvf": LVF, **changed})
    bench.clock.spend(1.0)
    bench.do("grey card", "lvf before camera", *tasks)
    return bench


def hue(frame: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[int]:
    """The strongest channel a fifth, half and four fifths along the strip."""
    cells = colours(frame)[10:22, 4:44].mean(axis=0)
    return [int(cells[at].argmax()) for at in (8, 18, 32)]


def test_the_camera_sees_a_spectrum_and_the_dark_holder() -> None:
    frame = grey_through_lvf().shoot(1 / 4, 100)
    assert hue(frame) == [2, 1, 0]
    assert frame[:14].mean() == pytest.approx(0, abs=2)
    assert frame[18:46, 40:56].min() > 200


def test_turned_it_runs_the_other_way() -> None:
    turned = grey_through_lvf(faults=["lvf_turned"]).shoot(1 / 4, 100)
    falling = {**LVF, "before_camera": {**STRIP, "rising": False}}
    built = grey_through_lvf(lvf=falling).shoot(1 / 4, 100)
    assert hue(turned) == [0, 1, 2]
    assert np.array_equal(turned, built)


def test_mercury_lines_are_where_the_filter_says() -> None:
    bench = grey_through_lvf("lamp mercury")
    bench.clock.spend(300.0)
    cells = colours(bench.shoot(1 / 4, 100))[10:22].mean(axis=0)
    u = (2 * np.arange(48) + 1 - 8) / 80
    for line_nm, channel, around in ((435.8335, 2, 0.1), (546.075, 1, 0.06)):
        expected = (line_nm - 400) / 300
        near = np.abs(u - expected) < around
        centroid = np.average(u[near], weights=np.maximum(cells[near, channel], 0))
        assert centroid == pytest.approx(expected, abs=2 / 300)


def test_a_skipped_filter_shows() -> None:
    def green_to_red(*tasks: str, **changed: object) -> float:
        profile = columns(grey_through_lvf(*tasks, **changed).shoot(1 / 4, 100))
        return float(profile[20] / profile[35])

    without, filtered = green_to_red(), green_to_red("filter minus-530")
    assert filtered < 0.3 * without
    skipped = green_to_red("filter minus-530", faults=["filter_skipped"])
    assert skipped == pytest.approx(without, rel=0.02)


def stripes(**changed: object) -> Darkroom:
    """Ten minutes through the LVF on the sample, then the door is open."""
    bench = Darkroom(**{"lvf": LVF, "door": {}, **changed})
    bench.do("lvf on sample")
    bench.charge(600.0)
    bench.swing(DOOR.open)
    return bench


def test_the_sample_glows_where_its_band_was_and_the_lvf_stays_behind() -> None:
    bench = stripes()
    frame = bench.shoot(1.0)
    profile = columns(frame)
    # Blue paint's strongest band, 437 to 475 nm, of the filter's 400 to 700.
    assert 400 + 300 * (2 * profile.argmax() + 1 - 8) / 80 == pytest.approx(456, abs=12)
    assert profile[40] < 0.05 * profile.max()
    assert frame[4:14].max() < 0.02 * frame.max()
    bench.do("lvf away")
    after = bench.shoot(1.0)
    assert columns(after) == pytest.approx(0.96 * profile, rel=0.05, abs=20)


def test_turned_on_the_sample_it_excites_the_other_way_round() -> None:
    falling = {**LVF, "on_sample": {**STRIP, "rising": False}}
    plain, turned, built = (
        stripes(**changed).shoot() for changed in ({}, {"faults": ["lvf_turned"]}, {"lvf": falling})
    )
    assert np.array_equal(turned, built)
    assert columns(turned).argmax() == pytest.approx(47 - columns(plain).argmax(), abs=1)


def test_without_a_door_the_sample_is_seen_through_the_lvf_on_it() -> None:
    bench = Darkroom(lvf=LVF, initial={"concentration": 0.5})
    bare = columns(bench.shoot())
    bench.do("lvf on sample")
    covered = columns(bench.shoot())
    bench.do("lvf away", "lvf before camera")
    before = columns(bench.shoot())
    assert covered.max() < 0.3 * bare.max()
    # The strips lie a few pixels apart, over a spectrum that is steep.
    assert covered == pytest.approx(before, rel=0.15, abs=20)


def test_without_a_door_the_lamp_passes_the_lvf_on_the_sample_twice() -> None:
    def lit(*tasks: str) -> float:
        bench = Darkroom(lvf={**LVF, "leakage": 0}, initial={"lamp": "on"})
        bench.clock.spend(1.0)
        bench.do(*tasks)
        return float(columns(bench.shoot(1 / 30, 100))[22:26].mean())

    once, twice = lit("lvf before camera"), lit("lvf on sample")
    # ∫ T² over ∫ T of a band that is 0.57 high.
    assert twice / once == pytest.approx(0.44, abs=0.04)


def test_charging_below_the_lvf_is_less_by_its_transmission() -> None:
    """Blue paint in one narrow band: r grows as that band's part of the white lamp's κ."""
    bench = stripes()
    truth = bench.room.truth()
    assert truth.lvf is not None
    (patch,) = truth.patches
    (state,) = patch.states
    assert state.concentration is not None
    plain = Darkroom(door={})
    plain.charge(600.0)
    ((white,),) = (patch.states for patch in plain.room.truth().patches)
    assert white.concentration is not None
    assert 0.002 < state.concentration / white.concentration < 0.05


def test_the_truth_knows_strip_and_bands() -> None:
    bench = Darkroom(lvf={**LVF, "before_camera": {"region": [0.1, 0.25, 0.8, 0.5], "tilt": 10}})
    lvf = bench.room.truth().lvf
    assert lvf is not None
    assert len(lvf.u) == len(lvf.centre_nm) == len(lvf.transmission) == 31
    assert lvf.centre_nm == pytest.approx([400 + 300 * u for u in lvf.u], abs=0.5)
    assert lvf.fwhm_nm[15] == pytest.approx(25, rel=0.02)
    best_nm = WAVELENGTH_NM[np.argmax(lvf.transmission, axis=1)]
    assert best_nm == pytest.approx(lvf.centre_nm, abs=3)
    assert np.subtract(lvf.before_camera.right, lvf.before_camera.left) == pytest.approx(
        (76.8 * math.cos(math.radians(10)), 76.8 * math.sin(math.radians(10)))
    )
    assert lvf.before_camera.height == 32
    assert Darkroom().room.truth().lvf is None


def test_changes_by_hand_do_not_change_earlier_photographs() -> None:
    prompt, late = Darkroom(lvf=LVF), Darkroom(lvf=LVF)
    taken = []
    for bench in (prompt, late):
        bench.do("lvf on sample", "filter minus-505")
        bench.charge(60.0)
        bench.do("lvf away")
        start_s = bench.clock.now()
        bench.clock.spend(2.0)
        if bench is late:
            bench.do("blank", "lvf before camera", "lamp mercury", "no filter")
            bench.charge(30.0)
            bench.do("fresh sample")
        taken.append(bench.room.photograph(start_s, 1.0, 400, 4.0))
    assert taken[0] == taken[1]


def test_a_change_during_an_exposure_counts_from_then_on() -> None:
    bench = Darkroom(lvf=LVF, initial={"lamp": "on"})
    bench.clock.spend(1.0)
    bench.do("grey card")
    whole = bench.shoot(1 / 64, 100)
    start_s = bench.clock.now()
    bench.clock.spend(1 / 128)
    bench.do("lvf before camera")
    bench.clock.spend(1 / 128)
    half = mosaic(bench.room.photograph(start_s, 1 / 64, 100, 4.0))
    assert half[:14].mean() == pytest.approx(whole[:14].mean() / 2, rel=0.02)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"lvf": {"centre": [700, 400]}}, "rise from the blue end"),
        ({"lvf": {"centre": [400, 430], "bend_nm": 10}}, "five times 'bend_nm'"),
        ({"lvf": {"fwhm": 25}}, "did you mean 'fwhm_nm'"),
        ({"faults": ["lvf_turned"]}, "a fault of the LVF needs an 'lvf:'"),
    ],
)
def test_mistakes_are_named(content: dict[str, object], said: str) -> None:
    with pytest.raises(UsageError) as refusal:
        validate({**SMALL, **content}, Simulation, "rig.yaml")
    assert said in str(refusal.value)


def test_a_strip_outside_the_frame_is_refused() -> None:
    with pytest.raises(UsageError, match="leaves the frame"):
        Darkroom(lvf={"before_camera": {"region": [20, 20, 90, 20]}})


def test_an_lvf_that_stays_away_changes_no_byte() -> None:
    def taken(**changed: object) -> list[bytes]:
        bench = Darkroom(**changed)
        bench.charge(60.0)
        start_s = bench.clock.now()
        bench.clock.spend(1.0)
        pictures = [bench.room.photograph(start_s, 1.0, 400, 4.0)]
        bench.do("grey card")
        bench.clock.spend(1.0)
        return [*pictures, bench.room.photograph(start_s + 1.0, 1.0, 400, 4.0)]

    assert taken(lvf=LVF) == taken()


def test_a_fresh_sample_has_no_stripes() -> None:
    bench = stripes()
    bench.do("lvf away", "fresh sample")
    bench.swing(DOOR.closed)
    bench.charge(60.0)
    bench.swing(DOOR.open)
    profile = columns(bench.shoot())[6:42]
    assert profile.std() < 0.05 * profile.mean()
