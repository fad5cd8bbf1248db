"""Photometry of dim light, against CIE 191 and the definitions."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.optics import (
    mesopic_adaptation,
    mesopic_ratio,
    photopic_efficacy,
    scotopic_efficacy,
)


def test_both_efficacies_are_equal_at_555_nm_and_zero_outside() -> None:
    assert abs(scotopic_efficacy(555.0) / photopic_efficacy(555.0) - 1) < 1e-3
    assert not photopic_efficacy([200.0, 900.0]).any()
    assert not scotopic_efficacy([200.0, 900.0]).any()


def test_the_limits_are_those_of_cie_191() -> None:
    assert mesopic_adaptation(5.0, 1.0) > 0.99
    assert mesopic_adaptation(0.005, 1.0) < 0.01
    # White light of S/P 1 has the same luminance for all eyes.
    assert mesopic_ratio(0.3, 1.0) == 1.0
    # At half adaptation, by V′(555 nm) = 683/1699: equation 2 of CIE 191 written out.
    assert mesopic_ratio(0.5, 2.0) == pytest.approx((1 + 2 * 683 / 1699) / (1 + 683 / 1699))


@given(st.floats(1e-4, 50), st.floats(0.2, 6))
def test_m_solves_its_own_equation(luminance: float, ratio: float) -> None:
    m = mesopic_adaptation(luminance, ratio)
    adapted = luminance * mesopic_ratio(m, ratio)
    assert abs(m - np.clip(0.767 + 0.3334 * np.log10(adapted), 0, 1)) < 1e-6
    low, high = sorted((1.0, ratio))
    assert low <= mesopic_ratio(m, ratio) <= high * (1 + 1e-12)
