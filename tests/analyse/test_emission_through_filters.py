"""The emission spectrum through colour filters before the camera, on a bench without an LVF."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from labrig.bench import Recording
from labrig.foundation.errors import UsageError
from labrig.process import process_run
from labrig.protocols.emission_spectrum.result import EmissionSpectrumResult
from labrig.protocols.excitation.result import ExcitationResult
from labrig.protocols.phosphor.result import PhosphorResult
from tests.analyse.camera_filters_bench import FILTERS, IN_WHEEL, PLACE, QUICK, recorded
from tests.analyse.selected_lights import FILTERS as LAMP_FILTERS, QUICK as EXCITATION, true_rates
from tests.analyse.spectral_bench import emitted
from tests.results.made import assert_read_back

#: Filters differ by 1 % from their files.
BENT: dict[str, Any] = {"filters_bent": 0.01}
BY_HAND = [f"put the colour filter {name} before the camera" for name in FILTERS[len(IN_WHEEL) :]]


def spectrum_of(run: Path) -> EmissionSpectrumResult:
    result = process_run(run)
    assert isinstance(result, EmissionSpectrumResult)
    return result


@pytest.fixture(scope="module")
def yellow(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("yellow"), seed=3, sample="yellow-paint", **BENT)


def test_the_spectrum_is_the_samples(yellow: Path) -> None:
    result = spectrum_of(yellow)
    assert_read_back(result)
    assert result.warnings == ()
    (patch,) = result.patches.values()
    assert patch.filters == FILTERS
    assert patch.white_reference
    assert not patch.changes_with_time
    value, sigma = np.array(patch.spectrum.value), np.array(patch.spectrum.sigma)
    difference = value - emitted("yellow-paint") * value.sum()
    assert np.sqrt(np.mean(difference**2)) < 0.08
    assert np.sqrt(np.mean((difference / np.maximum(sigma, 2e-3)) ** 2)) < 1.5
    assert np.median(sigma) > 0.01
    grid_nm, true = np.array(patch.spectrum.wavelength_nm), emitted("yellow-paint")
    centroid = patch.spectrum.centroid
    assert abs(centroid.value - grid_nm @ true) < 3 * centroid.sigma
    assert centroid.sigma < 5


def test_filters_that_the_wheel_has_not_are_put_in_by_hand(yellow: Path) -> None:
    recording = Recording.prepare(yellow / "protocol.yaml", yellow / "rig.yaml", yellow.parent)
    assert list(recording.plan.manual_steps) == [
        *BY_HAND,
        "take the colour filter before the camera away",
        "lay the grey card where lamp and camera both see it",
        *BY_HAND,
        "take the card away, so that the sample lies in its place",
        "take the colour filter before the camera away",
    ]
    wheel = [one.action for one in recording.plan.steps if one.device == "camera_filter_wheel"]
    assert list(dict.fromkeys(wheel)) == ["no filter", *(f"filter {name}" for name in IN_WHEEL)]


def test_a_glow_that_grows_from_charge_to_charge_is_told(tmp_path: Path) -> None:
    """Charges too short to be alike: what is left of one adds to the next."""
    keys = QUICK | {"charge": "3 s", "times": ["2 s"], "white": False}
    (warning,) = spectrum_of(recorded(tmp_path, keys, seed=4, sample="red-paint")).warnings
    assert warning.code == "glow-not-repeated"
    assert warning.values["change_percent"] > 0


def test_too_few_filters(tmp_path: Path) -> None:
    keys = QUICK | {"select": {"filters": list(FILTERS[:3])}}
    with pytest.raises(UsageError, match="select"):
        recorded(tmp_path, keys)


@pytest.mark.campaign
def test_a_whole_phosphor_without_an_lvf(tmp_path: Path) -> None:
    lights = {"filters": list(LAMP_FILTERS)}
    chain: dict[str, Any] = {
        "protocol": "phosphor",
        "sample": {"name": "yellow-paint"},
        "parts": [
            {"protocol": "irradiance", "select": lights, "sites": list(PLACE)},
            QUICK,
            {"protocol": "decay", "charge": "4 min", "for": "10 min", "repeats": 1},
            EXCITATION | {"select": lights, "sites": list(PLACE)},
        ],
    }
    chain["parts"] = [
        {key: value for key, value in part.items() if key != "sample"} for part in chain["parts"]
    ]
    result = process_run(recorded(tmp_path, chain, seed=6, sample="yellow-paint", **BENT))
    assert isinstance(result, PhosphorResult)
    excitation = result.parts["excitation"]
    assert isinstance(excitation, ExcitationResult)
    (patch,) = excitation.patches.values()
    assert patch.material.spectrum is not None
    (truth,) = 4 * true_rates("yellow-paint")
    (state,) = patch.fit.states
    assert (np.abs(state.k_e_per_s - truth) < 3.5 * state.k_e_per_s_sigma + 1e-5).all()
