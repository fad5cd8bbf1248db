"""Logarithms of light in tables, and their σ."""

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.results import parse_series
from labrig.text_table.names import log_scale


@pytest.mark.parametrize(
    ("name", "number", "light"),
    [
        ("I/dB", 30.0, 1000.0),
        ("I_dB", 30.0, 1000.0),
        ("Power [dBm]", 20.0, 100.0),
        ("U / dB", 40.0, 100.0),
        ("level dBV", 20.0, 10.0),
        ("I (dB re 1 mW)", 10.0, 10.0),
        ("ln(I)", 1.0, np.e),
        ("lnI", 1.0, np.e),
        ("ln(I/mV)", 2.0, np.e**2),
        ("log10(counts)", 3.0, 1000.0),
        ("lg(I/cps)", 3.0, 1000.0),
        ("I [log10]", 2.0, 100.0),
        ("Natural log of intensity", 1.0, np.e),
        ("Intensity, log10", 2.0, 100.0),
        ("E (ln(lx))", 1.0, np.e),
        ("log2(I)", 3.0, 8.0),
        ("V/mag", 5.0, 0.01),
    ],
)
def test_a_logarithm_becomes_light(name: str, number: float, light: float) -> None:
    scale = log_scale(name)
    assert scale is not None
    assert scale.light(np.array([number]))[0] == pytest.approx(light)
    # σ to first order is the difference that a small change makes.
    change = scale.light(np.array([number + 1e-6])) - scale.light(np.array([number - 1e-6]))
    sigma = scale.sigma(np.array([number]), np.array([1e-6]))
    assert sigma[0] == pytest.approx(abs(change[0]) / 2, rel=1e-5)


@pytest.mark.parametrize(
    "name",
    [
        "y/dB",
        "dB",
        "log(I)",
        "log counts",
        "logI",
        "ln(I0/I)",
        "-ln(I)",
        "1/I",
        "sqrt(I)",
        "I_log",
        "log-transformed I",
    ],
)
def test_what_has_two_readings_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match=r"expected (light|decibels)"):
        log_scale(name)


@pytest.mark.parametrize(
    "name",
    ["I", "counts", "I / mV", "Login", "lamp_log", "log 1", "line", "1/s", "I (a.u.)", "%",
     "luminance/(mcd/m2)", "expected", "absorbance", "magnitude", "channel 1"],
)  # fmt: skip
def test_light_is_left_alone(name: str) -> None:
    assert log_scale(name) is None


def test_values_and_sigma_of_a_table_are_those_of_the_light() -> None:
    (series,) = parse_series("t,I/dB,σ/dB\n0,30,0.1\n1,20,0.1\n", "x")
    assert series.channels == ("I",)
    assert series.values[:, 0] == pytest.approx([1000, 100])
    assert series.sigma[:, 0] == pytest.approx(np.log(10) / 10 * 0.1 * np.array([1000, 100]))
    (below,) = parse_series("t,I\ns,dBm\n0,30\n1,20\n", "x")
    assert (below.values[0, 0], below.value_unit) == (pytest.approx(1000), "mW")
    for unit in ("%", "mV"):
        with pytest.raises(UsageError, match=f"uncertainties of the logarithm.*'{unit}'"):
            parse_series(f"t,ln(I),Error ({unit})\n0,3,0.1\n1,2,0.1\n", "x")
