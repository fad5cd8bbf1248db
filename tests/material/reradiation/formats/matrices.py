"""Matrices for tests of files: two skewed dyes, the noise of an instrument, random ones."""

from dataclasses import fields

import numpy as np
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from labrig.material import ReradiationMatrix


def two_dyes(seed: int = 0, noise: float = 1.5e-3) -> ReradiationMatrix:
    """Two skewed dyes as a bispectral instrument measures them: noise everywhere, spill at ±1."""
    input_nm, output_nm = np.arange(300.0, 781.0, 10.0), np.arange(380.0, 781.0, 10.0)
    rng = np.random.default_rng(seed)
    values = noise * rng.standard_normal((41, 49))
    for peak_nm, emission_nm in ((380.0, 440.0), (470.0, 520.0)):
        excitation = np.exp(-(((input_nm - peak_nm) / 40) ** 2))
        apart = (output_nm - emission_nm) / 25
        emission = np.exp(-((apart / np.where(apart > 0, 1.6, 1.0)) ** 2))
        stokes = output_nm[:, np.newaxis] > input_nm
        values += np.where(stokes, 0.04 * np.outer(emission, excitation), 0.0)
    reflectance = np.linspace(0.3, 0.8, 41)
    distance = np.abs(output_nm[:, np.newaxis] - input_nm)
    values += np.where(distance == 10, 0.03, 0.0) * reflectance[:, np.newaxis]
    values = np.where(distance == 0, reflectance[:, np.newaxis], values)
    return ReradiationMatrix.from_bands("yellow paper", input_nm, output_nm, values)


def assert_same(actual: ReradiationMatrix, expected: ReradiationMatrix, rtol: float = 0.0) -> None:
    """All that a matrix has is the same."""
    for field in fields(ReradiationMatrix):
        value, expected_value = getattr(actual, field.name), getattr(expected, field.name)
        if isinstance(expected_value, np.ndarray):
            assert_allclose(value, expected_value, rtol=rtol, atol=0, err_msg=field.name)
        else:
            assert value == expected_value, field.name


@st.composite
def random_matrices(draw: st.DrawFn, even: bool = False, spaces: bool = True) -> ReradiationMatrix:
    """Matrices of any grids and numbers; with even ones, all measured."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)

    def grid() -> np.ndarray:
        size = draw(st.integers(2, 6))
        if even:
            start = float(draw(st.integers(250, 600)))
            return start + draw(st.integers(1, 20)) * np.arange(size, dtype=np.float64)
        return np.cumsum(rng.uniform(0.5, 40, size)) + 250

    input_nm, output_nm = grid(), grid()
    shape = len(output_nm), len(input_nm)
    if even:
        values = rng.uniform(-0.01, 1.9, shape)
        return ReradiationMatrix.from_bands("a name", input_nm, output_nm, values)
    reradiation = rng.standard_normal(shape) * 10.0 ** rng.uniform(-12, -3, shape)
    reradiation[rng.random(shape) < 0.2] = np.nan
    reflectance = rng.uniform(0, 1, len(output_nm))
    reflectance[rng.random(len(output_nm)) < 0.2] = np.nan
    name = draw(st.text("aZ9 é#:,;µ\t-", max_size=12))
    return ReradiationMatrix(
        " ".join(name.split()) or "x", input_nm, output_nm, reflectance, reradiation
    )
