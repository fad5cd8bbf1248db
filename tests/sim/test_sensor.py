"""Noise of the simulated sensor, measured as one measures a real one."""

import numpy as np
import pytest

from labrig.sim.sensor import (
    BLACK_DN,
    MAX_DN,
    WHITE_DN,
    Mosaic,
    Sensor,
    SensorTemperature,
    gain_electrons_per_dn,
    read_noise_electrons,
)

SHAPE = (200, 300)
COOL_C = 21.0


@pytest.fixture(scope="module")
def steady() -> Sensor:
    return Sensor(np.random.default_rng(5), np.ones(SHAPE), flicker=0.0)


def exposed(sensor: Sensor, electrons: float, seed: int, iso: int = 400, **other: float) -> Mosaic:
    light = np.full(SHAPE, electrons, dtype=np.float32)
    exposure_s, temperature_c = other.get("exposure_s", 0.01), other.get("temperature_c", COOL_C)
    return sensor.expose(light, exposure_s, iso, temperature_c, np.random.default_rng(seed))


@pytest.mark.parametrize("iso", [100, 400, 3200])
def test_photon_transfer_gives_the_gain(steady: Sensor, iso: int) -> None:
    gain = gain_electrons_per_dn(iso)
    signals, variances = [], []
    for dn in (0, 500, 2000, 5000, 9000):
        one, two = (exposed(steady, dn * gain, 10 * dn + i, iso).astype(float) for i in (1, 2))
        signals.append((one.mean() + two.mean()) / 2 - BLACK_DN)
        variances.append((one - two).var() / 2)
    slope, zero = np.polyfit(signals, variances, 1, w=1 / np.array(variances))
    assert 1 / slope == pytest.approx(gain, rel=0.03)
    # Rounding to whole numbers adds 1/12.
    assert zero == pytest.approx((read_noise_electrons(iso) / gain) ** 2 + 1 / 12, rel=0.05)


@pytest.mark.parametrize("electrons", [1.0, 3.0, 5.0, 30.0])
def test_few_photons_are_poisson_distributed(steady: Sensor, electrons: float) -> None:
    gain = gain_electrons_per_dn(6400)
    one, two = (
        (exposed(steady, electrons, i, 6400).astype(float) - BLACK_DN) * gain for i in (1, 2)
    )
    assert one.mean() == pytest.approx(electrons, rel=0.03)
    shot = (one - two).var() / 2 - read_noise_electrons(6400) ** 2
    assert shot == pytest.approx(electrons, rel=0.05, abs=0.1)
    skew = ((one - one.mean()) ** 3).mean()
    assert skew == pytest.approx(electrons, rel=0.3, abs=0.5)


def test_single_photons_fall_where_the_light_is(steady: Sensor) -> None:
    light = np.broadcast_to(np.linspace(0.02, 0.9, SHAPE[1]), SHAPE).astype(np.float32)
    gain, dark = gain_electrons_per_dn(6400), np.zeros(SHAPE, dtype=np.float32)
    lit, unlit = (
        np.array(
            [
                steady.expose(electrons, 0.01, 6400, COOL_C, np.random.default_rng([seed, n]))
                for n in range(60)
            ],
            dtype=float,
        )
        for seed, electrons in ((11, light), (12, dark))
    )
    mean = gain * (lit - unlit).mean(axis=(0, 1))
    assert np.polyfit(light[0], mean, 1) == pytest.approx([1, 0], abs=0.03)
    variance = gain**2 * (lit.var(axis=0, ddof=1) - unlit.var(axis=0, ddof=1)).mean(axis=0)
    assert np.polyfit(light[0], variance, 1) == pytest.approx([1, 0], abs=0.1)


def test_all_light_of_a_frame_flickers_together() -> None:
    sensor = Sensor(np.random.default_rng(5), np.ones((64, 96)), flicker=0.007)
    light = np.full((64, 96), 9000.0, dtype=np.float32)
    means = [
        sensor.expose(light, 1.0, 400, COOL_C, np.random.default_rng(i)).mean() - BLACK_DN
        for i in range(400)
    ]
    assert np.std(means) / np.mean(means) == pytest.approx(0.007, rel=0.1)


def test_dark_current_grows_with_time_and_warmth(steady: Sensor) -> None:
    def dark_electrons(exposure_s: float, temperature_c: float) -> float:
        frame = exposed(steady, 0.0, 1, 400, exposure_s=exposure_s, temperature_c=temperature_c)
        cold = np.delete(frame.reshape(-1), steady.hot_pixels)
        return float((cold.mean() - BLACK_DN) * gain_electrons_per_dn(400))

    assert dark_electrons(100.0, COOL_C) == pytest.approx(8.0, rel=0.05)
    assert dark_electrons(100.0, COOL_C + 6) == pytest.approx(16.0, rel=0.05)
    assert dark_electrons(200.0, COOL_C) == pytest.approx(16.0, rel=0.05)


def test_hot_pixels_stay_where_they_are(steady: Sensor) -> None:
    frames = [exposed(steady, 0.0, i, 800, exposure_s=30.0).reshape(-1) for i in (1, 2)]
    hottest = [set(np.argsort(frame)[-len(steady.hot_pixels) :]) for frame in frames]
    assert len(steady.hot_pixels) == 6
    assert hottest[0] == hottest[1] == set(steady.hot_pixels)
    assert frames[0][list(hottest[0])].min() > BLACK_DN + 200


def test_too_much_light_saturates(steady: Sensor) -> None:
    for iso in (100, 1600):
        frame = exposed(steady, 1e12, 1, iso)
        assert frame.min() > WHITE_DN
        assert frame.max() <= MAX_DN


def test_sensor_warms_by_itself_and_by_exposing() -> None:
    idle, busy = SensorTemperature(), SensorTemperature()
    assert idle.expose(0.0, 0.001) == pytest.approx(COOL_C, abs=0.01)
    for start_s in range(0, 600, 40):
        busy.expose(float(start_s), 30.0)
    after_idle, after_busy = idle.expose(600.0, 0.001), busy.expose(600.0, 0.001)
    assert after_idle == pytest.approx(COOL_C + 7 * (1 - np.exp(-1)), abs=0.01)
    assert 1.0 < after_busy - after_idle < 10.0


def test_noise_belongs_to_the_frame(steady: Sensor) -> None:
    assert np.array_equal(exposed(steady, 100.0, 1), exposed(steady, 100.0, 1))
    assert not np.array_equal(exposed(steady, 100.0, 1), exposed(steady, 100.0, 2))


def test_crosstalk_keeps_the_light_and_shares_the_noise() -> None:
    sensor = Sensor(np.random.default_rng(5), np.ones(SHAPE), flicker=0.0, crosstalk=0.05)
    one, two = (exposed(sensor, 9000.0, i).astype(float) for i in (1, 2))
    assert one.mean() - BLACK_DN == pytest.approx(9000 / gain_electrons_per_dn(400), rel=0.002)
    noise = (one - two) / np.sqrt(2)
    correlation = np.mean(noise[:, 1:] * noise[:, :-1]) / noise.var()
    # Kernel 0.8 in the middle, 0.05 around: (2 · 0.8 · 0.05) / (0.8² + 4 · 0.05²).
    assert correlation == pytest.approx(0.08 / 0.65, abs=0.02)


def test_crosstalk_reaches_the_neighbours_of_a_point() -> None:
    sensor = Sensor(np.random.default_rng(5), np.ones(SHAPE), flicker=0.0, crosstalk=0.05)
    light = np.zeros(SHAPE, dtype=np.float32)
    light[100, 150] = 10_000.0
    mosaic = sensor.expose(light, 0.01, 400, COOL_C, np.random.default_rng(1)).astype(float)
    signal = (mosaic - BLACK_DN) * gain_electrons_per_dn(400)
    assert signal[100, 150] == pytest.approx(8000, rel=0.05)
    for row, column in ((99, 150), (101, 150), (100, 149), (100, 151)):
        assert signal[row, column] == pytest.approx(500, abs=50)
    assert abs(signal[99, 149]) < 50


def test_rows_share_the_noise_of_their_readout() -> None:
    sensor = Sensor(np.random.default_rng(5), np.ones(SHAPE), flicker=0.0, row_noise=0.5)
    one, two = (exposed(sensor, 0.0, i, 400).astype(float) for i in (1, 2))
    difference = (one - two) / np.sqrt(2)
    read_dn = read_noise_electrons(400) / gain_electrons_per_dn(400)
    assert difference.mean(axis=1).std() == pytest.approx(0.5 * read_dn, rel=0.2)
    assert difference.mean(axis=0).std() == pytest.approx(read_dn / np.sqrt(SHAPE[0]), rel=0.2)
