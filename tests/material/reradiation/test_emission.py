"""Emission spectra of measured surfaces, and libraries of them."""

from pathlib import Path

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.material import (
    ReradiationMatrix,
    emission_spectrum,
    read_emissions,
    write_reradiation,
)

INPUT_NM, OUTPUT_NM = np.arange(300.0, 781.0, 10.0), np.arange(380.0, 781.0, 10.0)


def dyed(name: str, peak_nm: float, noise: float, yield_: float = 0.4) -> ReradiationMatrix:
    """A surface with one lopsided emission, noise on every entry as instruments have it."""
    width = np.where(peak_nm > OUTPUT_NM, 20.0, 35.0)
    emission = np.exp(-(((OUTPUT_NM - peak_nm) / width) ** 2) / 2)
    excitation = yield_ * np.exp(-(((INPUT_NM - peak_nm + 80) / 30) ** 2) / 2)
    bands = np.outer(emission / emission.sum(), excitation)
    bands *= OUTPUT_NM[:, np.newaxis] > INPUT_NM
    bands += 0.3 * (np.abs(OUTPUT_NM[:, np.newaxis] - INPUT_NM) < 1)
    bands += noise * np.random.default_rng(3).standard_normal(bands.shape)
    return ReradiationMatrix.from_bands(name, INPUT_NM, OUTPUT_NM, bands)


def test_an_emission_is_found_below_the_noise_of_single_columns() -> None:
    found, true = (emission_spectrum(dyed("dye", 540.0, noise)) for noise in (0.002, 0.0))
    first, second = (each.value / each.value.sum() for each in (found, true))
    assert np.abs(first - second).sum() / 2 < 0.05


def test_a_library_is_a_folder_of_matrices_and_tables(tmp_path: Path) -> None:
    write_reradiation(tmp_path / "green.BFC", dyed("green", 520.0, 0.001))
    write_reradiation(tmp_path / "grey.BFC", dyed("grey", 520.0, 0.001, yield_=0.0))
    (tmp_path / "more.csv").write_text("wavelength_nm,a,b\n500,0,1\n550,1,0.2\n600,0.1,0\n")
    assert [each.name for each in read_emissions(tmp_path)] == ["green", "a", "b"]


def test_what_is_no_library_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("foo,bar\n")
    for place, said in ((tmp_path, "x.csv"), (tmp_path / "none", "expected an emission_library")):
        with pytest.raises(UsageError, match=said) as caught:
            read_emissions(place)
        assert "\n" not in str(caught.value)
    (tmp_path / "x.csv").unlink()
    with pytest.raises(UsageError, match="got none that re-radiates"):
        read_emissions(tmp_path)
