"""Spectra of real dyes and lamps, through curves of two laboratories; a real filter sensor."""

import numpy as np
import pytest

from labrig.fit.spectrum import CurveError, system_through_lvf
from tests.acceptance import lightlogger
from tests.acceptance.spectrum_through_lvf import colour_errors, coverage
from tests.fit import lvf_pictures as made


@pytest.mark.usefixtures("shared_data")
@pytest.mark.campaign
def test_bands_of_real_dyes_cover_them() -> None:
    lvf, ours = made.curved_lvf(), made.of_the_house()
    dyes = made.fluorophores(3)
    exact = system_through_lvf(lvf, ours, made.KNOTS_NM)
    _, bright = coverage(dyes, ours, exact, lvf)
    assert bright[0] > 0.6
    assert bright[1] > 0.85
    unsure = system_through_lvf(lvf, ours, made.KNOTS_NM, CurveError())
    _, bright = coverage(dyes, made.of_another_laboratory(), unsure, lvf)
    assert bright[0] > 0.55
    assert bright[1] > 0.8


@pytest.mark.usefixtures("shared_data")
@pytest.mark.campaign
def test_the_colour_checker_through_the_filter() -> None:
    lvf, ours = made.curved_lvf(), made.of_the_house()
    exact = system_through_lvf(lvf, ours, made.KNOTS_NM)
    same = colour_errors(ours, exact, lvf)["the lamp"]
    assert same.mean() <= 0.7
    assert np.percentile(same, 95) <= 2
    other = colour_errors(made.of_another_laboratory(), exact, lvf)
    assert 0.9 < other["the lamp"].mean() < 1.9
    assert other["the lamp as measured"].mean() < 0.7


@pytest.mark.campaign
def test_peaks_told_by_a_real_sensor_of_18_channels() -> None:
    # One third of the wavelengths; python -m tests.acceptance.lightlogger holds out each in turn.
    errors = np.abs([one.error_nm for one in lightlogger.told(lightlogger.every(3)[1], (30,))])
    assert len(errors) == 10
    assert np.median(errors) < 2.0
    assert errors.max() < 10.0
