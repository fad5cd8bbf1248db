"""What keeps photographs from being ideal, each switch by what it does to them."""

from collections.abc import Callable

import numpy as np
import pytest

from labrig.foundation.arrays import FloatArray
from labrig.sim.arrangement import Arrangement
from labrig.sim.bench_settings import ImagingSettings, LvfSettings, StripSettings
from labrig.sim.imaging import Imaging
from labrig.sim.lamp import C2_NM_K, WAVELENGTH_NM, Lamp
from labrig.sim.layout import PIECES, Lvf
from labrig.sim.sensor import BLACK_DN, Sensor, gain_electrons_per_dn
from labrig.sim.simulation import LampSettings
from labrig.sim.wander import ZERO_S, OrnsteinUhlenbeckNoise, Ripple
from tests.sim.darkroom import SMALL, Darkroom, colours

#: A glowing sample in the left half of the frame; the right half is cloth.
HALF = [{"material": "blue-paint", "region": [0.0, 0.0, 0.5, 1.0]}]
GLOWING = {"sample": HALF, "initial": {"concentration": 0.9}}
EVEN = np.full((64, 96), 5000.0, dtype=np.float32)
FLAT = np.ones((64, 96))


def lit(**changed: object) -> FloatArray:
    """Both halves of a frame under the lamp, shape (2, colours)."""
    lamp = {"warm_up_deficit": "0 %", "drift_per_hour": "0 %"}
    bench = Darkroom(**{"sample": HALF, "lamp": lamp, **changed})
    bench.room.switch_lamp(True)
    bench.clock.spend(10.0)
    frame = colours(bench.shoot(1 / 100, 100, 8.0))
    return np.array([frame[:, 2:22].mean(axis=(0, 1)), frame[:, 26:46].mean(axis=(0, 1))])


@pytest.mark.parametrize("glare", [0.003, 0.03])
def test_glare_veils_the_frame_with_its_mean_light(glare: float) -> None:
    clean = colours(Darkroom(**GLOWING).shoot(2.0, 100))
    veiled = colours(Darkroom(**GLOWING, imaging={"glare": glare}).shoot(2.0, 100))
    added = (veiled - clean)[:, 26:46].mean(axis=(0, 1))
    assert added[1:] == pytest.approx(glare * clean.mean(axis=(0, 1))[1:], rel=0.1)
    assert veiled.mean() == pytest.approx(clean.mean(), rel=0.01)


@pytest.mark.parametrize("sigma_px", [2.0, 5.0])
def test_defocus_blurs_an_edge(sigma_px: float) -> None:
    edge = np.where(np.arange(96) < 48, 1000.0, 0.0) * np.ones((64, 1))
    blurred = Imaging(ImagingSettings(defocus_px=sigma_px), 1).imaged(edge.astype(np.float32))
    slope = -np.diff(blurred[20, ::2])
    at = 2.0 * np.arange(len(slope))
    middle = slope @ at / slope.sum()
    assert np.sqrt(slope @ (at - middle) ** 2 / slope.sum()) == pytest.approx(sigma_px, rel=0.05)


def test_texture_stays_with_a_sample_until_it_is_put_in_anew() -> None:
    imaging = Imaging(ImagingSettings(texture=0.04, texture_px=1.5), 1)
    first, again = (imaging.textured(EVEN, Arrangement()) / EVEN for _ in range(2))
    anew = imaging.textured(EVEN, Arrangement(placing=1)) / EVEN
    assert first.std() == pytest.approx(0.04, rel=0.01)
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first.ravel(), anew.ravel())[0, 1]) < 0.2
    assert np.corrcoef(first[:, :-1].ravel(), first[:, 1:].ravel())[0, 1] > 0.7


def test_texture_is_seen_in_photographs() -> None:
    smooth, rough = (
        colours(Darkroom(**GLOWING, imaging={"texture": texture}).shoot(1.0, 100))[4:28, 2:22, 1]
        for texture in (0.0, 0.1)
    )
    assert rough.std() / rough.mean() > 2 * smooth.std() / smooth.mean()


def test_what_wanders_is_normal_and_forgets_exponentially() -> None:
    times_s = ZERO_S + np.array([0.0, 10.0, 30.0, 300.0])
    courses = [
        OrnsteinUhlenbeckNoise(np.random.default_rng([7, seed]), 30.0) for seed in range(1500)
    ]
    values = np.array([[course(t) for t in times_s] for course in courses])
    assert values.std(axis=0) == pytest.approx(np.ones(4), abs=0.08)
    correlation = np.corrcoef(values.T)[0]
    assert correlation[1:] == pytest.approx(np.exp([-1 / 3, -1.0, -10.0]), abs=0.08)


def exposed(sensor: Sensor, at_s: float, electrons: float = 5000.0) -> float:
    light = np.full(FLAT.shape, electrons, dtype=np.float32)
    rng = np.random.default_rng(round(at_s))
    return float(sensor.expose(light, 0.01, 400, 21.0, rng, at_s).mean()) - BLACK_DN


@pytest.fixture
def course() -> Callable[[float], float]:
    return OrnsteinUhlenbeckNoise(np.random.default_rng(3), 60.0)


def test_correlated_flicker_and_black_level_follow_their_course(
    course: Callable[[float], float],
) -> None:
    times_s = ZERO_S + np.arange(0.0, 600.0, 30.0)
    wander = np.array([course(t) for t in times_s])
    steady = Sensor(np.random.default_rng(5), FLAT, 0.0)
    flickering = Sensor(np.random.default_rng(5), FLAT, 0.05, flicker_course=course)
    ratio = [exposed(flickering, t) / exposed(steady, t) - 1 for t in times_s]
    assert ratio == pytest.approx(0.05 * wander, abs=1e-3)
    black = Sensor(np.random.default_rng(5), FLAT, 0.0, black_course_dn=lambda t: 3 * course(t))
    shift = [exposed(black, t, 0.0) - exposed(steady, t, 0.0) for t in times_s]
    assert shift == pytest.approx(3 * wander, abs=0.1)


def test_a_room_flickers_alike_in_frames_that_follow_each_other() -> None:
    """Also if it is opened anew between them."""
    sensor = {"width": 96, "height": 64, "flicker": 0.05, "flicker_over": "1 h"}
    lamp = {"warm_up_deficit": "0 %", "drift_per_hour": "0 %"}
    bright = []
    for delay_s in (10.0, 20.0, 30.0, 20_000.0):
        bench = Darkroom(sensor=sensor, lamp=lamp)
        bench.room.switch_lamp(True)
        bench.clock.spend(delay_s)
        bright.append(bench.shoot(1 / 100, 100, 8.0)[20:44].mean())
    changes = np.abs(np.array(bright) / bright[0] - 1)
    assert changes[:3].max() < 0.01
    assert changes[3] > 5 * changes[:3].max()


def test_a_rooms_black_level_wanders() -> None:
    sensor = {"width": 96, "height": 64, "black_wander_dn": 5.0, "black_wander_over": "1 min"}
    bench = Darkroom(sample=HALF, sensor=sensor)
    levels = []
    for _ in range(30):
        levels.append(bench.shoot(0.01, 100)[20:44].mean())
        bench.clock.spend(180.0)
    assert np.std(levels) == pytest.approx(5.0, rel=0.4)


@pytest.mark.parametrize("nonlinearity", [0.01, 0.05])
def test_a_large_signal_falls_short_of_proportion(nonlinearity: float) -> None:
    straight = Sensor(np.random.default_rng(5), FLAT, 0.0)
    bent = Sensor(np.random.default_rng(5), FLAT, 0.0, nonlinearity=nonlinearity)
    full = (15_760 - 1024) * gain_electrons_per_dn(400)
    for part in (0.1, 0.5, 0.9):
        ratio = exposed(bent, 1.0, part * full) / exposed(straight, 1.0, part * full)
        assert 1 - ratio == pytest.approx(nonlinearity * part, rel=0.05, abs=2e-5)
    assert exposed(bent, 1.0, 2 * full) == pytest.approx(15_760 - 1024, abs=2)


def test_an_ageing_lamp_becomes_redder() -> None:
    settings = LampSettings(warm_up_deficit=0.0, drift_per_hour=0.0, cooling_per_hour=10.0)
    lamp = Lamp.found(settings, on=True)
    ratio = lamp.irradiance(3 * 3600.0) / lamp.irradiance(0.0)
    wien = np.exp(C2_NM_K / WAVELENGTH_NM * (1 / 3000 - 1 / 2970))
    at_560 = np.interp(560.0, WAVELENGTH_NM, wien)
    assert ratio == pytest.approx(wien / at_560, rel=1e-4)
    assert ratio[0] < 0.95 < 1.01 < ratio[-1]
    exposure = lamp.exposure(10_790.0, 10_810.0)
    assert exposure == pytest.approx(20 * lamp.irradiance(10_800.0), rel=1e-4)


def test_surfaces_light_one_another() -> None:
    alone, together = lit(), lit(inter_reflection=0.2)
    reflectance = np.array([[0.5], [0.03]])
    added = 0.2 * alone.mean(axis=0) * reflectance
    assert together - alone == pytest.approx(added, rel=0.1, abs=1.0)


def test_light_below_the_filter_spreads_along_the_strip() -> None:
    strip = StripSettings(region=(0.1, 0.3, 0.8, 0.4))
    sharp, spread = LvfSettings(on_sample=strip), LvfSettings(on_sample=strip, spread=0.02)
    at = np.argmin(np.abs(WAVELENGTH_NM - 550.0))
    u = (np.arange(PIECES) + 0.5) / PIECES

    def width(settings: LvfSettings) -> float:
        profile = Lvf(settings).below(strip, turned=False)[1:, at] - settings.leakage
        middle = profile @ u / profile.sum()
        return float(np.sqrt(profile @ (u - middle) ** 2 / profile.sum()))

    assert width(spread) ** 2 - width(sharp) ** 2 == pytest.approx(0.02**2, rel=0.02)
    assert np.array_equal(Lvf(sharp).below(strip, False), Lvf(sharp).seen(strip, False))
    assert np.array_equal(Lvf(spread).seen(strip, False), Lvf(sharp).seen(strip, False))


def test_nothing_of_it_is_there_unless_it_is_switched_on() -> None:
    bench = Darkroom(**SMALL)
    imaging = Imaging(bench.simulation.imaging, 1)
    assert imaging.imaged(EVEN) is EVEN
    assert imaging.textured(EVEN, Arrangement()) is EVEN


def test_a_ripple_is_a_sine_of_which_an_exposure_takes_the_mean() -> None:
    ripple = Ripple(np.random.default_rng(2), 0.05, 4.0)
    begins_s = ZERO_S + np.linspace(0, 8, 33)
    at_once = np.array([ripple.mean(begin_s, 1e-6) for begin_s in begins_s])
    assert np.abs(at_once).max() == pytest.approx(0.05, rel=0.02)
    assert at_once[16:] == pytest.approx(at_once[:17], abs=1e-6)
    fine = [ripple.mean(begins_s[3] + t, 0.0) for t in (np.arange(1000) + 0.5) / 1000]
    assert ripple.mean(begins_s[3], 1.0) == pytest.approx(np.mean(fine), rel=1e-5)
    assert ripple.mean(begins_s[3], 4.0) == pytest.approx(0.0, abs=1e-12)
    steady = Sensor(np.random.default_rng(5), FLAT, 0.0)
    rippled = Sensor(np.random.default_rng(5), FLAT, 0.0, ripple=ripple.mean)
    ratio = exposed(rippled, begins_s[3]) / exposed(steady, begins_s[3]) - 1
    assert ratio == pytest.approx(ripple.mean(begins_s[3], 0.01), abs=1e-3)
