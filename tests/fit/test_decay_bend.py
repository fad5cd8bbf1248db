"""A sensor that is not linear: told by the channels' ratios, and only where it matters."""

import numpy as np
import pytest

from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.results import Measured
from tests.fit import truths
from tests.warned import codes, of_code

SNR = 1000.0
#: Mean of the first exposure, over the signal at lamp off.
FIRST = float(np.exp(-0.03 * 0.3) * -np.expm1(-0.03 * 1.5) / (0.03 * 1.5))


def fitted(
    seed: int, bend: float = 0.0, colour: float = 0.0, t_s: FloatArray = truths.TIMES_S
) -> DecayFit:
    """One state seen by a sensor that is off by `bend` at signal 1, and a light of other colour."""
    seen = truths.observe(truths.exponentials((0.03, 1.0)), seed, snr=SNR, t_s=t_s)
    values = seen.values * (1 + bend * seen.values)
    values[:, 0] += colour * np.exp(-0.01 * t_s)
    return fit_decay(
        seen.t_s,
        values,
        seen.sigma,
        exposure_s=seen.exposure_s,
        channels="RGB",
        n_states=1,
        flicker=0.007,
    )


def is_bent(fit: DecayFit) -> bool:
    return "sensor-nonlinear" in codes(fit.warnings)


def bend_of(fit: DecayFit) -> Measured:
    """Return the deviation at the brightest in % that the only warning of a bend has."""
    return Measured(**of_code(fit.warnings, "sensor-nonlinear").values["deviation"])


def test_there_is_no_warning_without_a_bend() -> None:
    assert not any(is_bent(fitted(3000 + seed)) for seed in range(20))


@pytest.mark.parametrize("bend", [-0.03, 0.03])
def test_it_is_reported_once_by_its_size(bend: float) -> None:
    """The first exposure shows 0.97 of the signal at lamp off."""
    for seed in range(6):
        fit = fitted(4000 + seed + int(1000 * bend), bend)
        found = bend_of(fit)
        assert abs(found.value - 100 * abs(bend) * FIRST) < 3.5 * found.sigma
        direction = of_code(fit.warnings, "sensor-nonlinear").values["direction"]
        assert direction == ("fall short of" if bend < 0 else "exceed")
        assert "colour-changes" not in codes(fit.warnings)


@pytest.mark.campaign
def test_its_sigma_is_right() -> None:
    found = [bend_of(fitted(7000 + seed, -0.03)) for seed in range(200)]
    pulls = [(bend.value - 3.0 * FIRST) / bend.sigma for bend in found]
    assert abs(np.mean(pulls)) < 0.25
    assert 0.87 < np.std(pulls) < 1.13


def test_a_light_of_another_colour_is_no_bend() -> None:
    fit = fitted(5000, colour=0.02)
    assert not is_bent(fit)
    assert "colour-changes" in codes(fit.warnings)


def test_one_channel_does_not_determine_it() -> None:
    seen = truths.observe(truths.exponentials((0.03, 1.0)), 6000, snr=SNR, flicker=0.0)
    values = seen.values[:, 1] * (1 - 0.03 * seen.values[:, 1])
    assert not is_bent(fit_decay(seen.t_s, values, seen.sigma[:, 1], exposure_s=1.5, n_states=1))
