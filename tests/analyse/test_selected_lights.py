"""Irradiance and excitation by lights that are selected one after another, against the room's."""

from pathlib import Path

import numpy as np
import pytest

from labrig.calibration import IRRADIANCE_KIND
from labrig.foundation.errors import DataError, UsageError
from labrig.process import process_run
from labrig.protocols.excitation.result import ExcitationResult
from labrig.protocols.irradiance.result import IrradianceResult
from labrig.sim.simulation import Simulation
from tests.analyse.lvf_calibration.room_truth import simulation_of
from tests.analyse.recorded import part_of, record
from tests.analyse.selected_lights import (
    LED_NAMES,
    QUICK,
    SITES,
    bench,
    recorded,
    true_light,
    true_rates,
)
from tests.results.made import assert_read_back
from tests.warned import codes

THREE = LED_NAMES[:3]
SMALL = {"width": 48, "height": 32}


def room(seed: int) -> Simulation:
    """The room of the shipped bench, with LEDs."""
    rig = {"devices": {"lamp": {}}, "simulation": {"sample": "blue-paint", "lvf": {}}}
    bench("leds", seed=seed)(rig)
    return Simulation.model_validate(rig["simulation"])


def test_a_spectrometer_tells_the_light_of_leds(tmp_path: Path) -> None:
    keys = {
        "protocol": "irradiance", "select": {"leds": list(THREE)}, "sites": list(SITES),
        "bands_nm": [400, 437.5, 475, 512.5], "rounds": 1, "repeats": 1, "longest": "1 s",
        "repetitions": 3,
    }  # fmt: skip
    run = record(tmp_path, keys, bench("leds", has_spectrometer=True, seed=41, sensor=SMALL))
    result = process_run(run)
    assert isinstance(result, IrradianceResult)
    assert_read_back(result)
    file = result.calibration
    assert file.lights == THREE
    true = true_light("leds", simulation_of(run), file.bands_nm)
    found, expected = (np.array(each.through)[:3].sum(axis=1) for each in (file, true))
    sigma = np.array(file.ratio_sigma) / np.array(file.ratio)
    assert sigma.max() < 0.02
    assert (np.abs(found / expected - 1) < 3 * sigma).all()
    own = np.array(file.through).argmax(axis=1)
    assert own.tolist() == [0, 1, 2]
    assert np.array(file.centre_nm) == pytest.approx([418, 456, 494], abs=2)
    with pytest.raises(UsageError, match="got that of 415 nm, 455 nm, 495 nm"):
        file.lvf_strip()


def test_a_light_whose_irradiance_is_not_known(tmp_path: Path) -> None:
    light = true_light("leds", room(1)).model_copy(update={"lights": ("x", *LED_NAMES[1:])})
    IRRADIANCE_KIND.write(tmp_path, light)
    keys = QUICK | {"select": {"leds": [LED_NAMES[0]]}, "charges": ["5 s"], "direct": ["5 s"]}

    def change(rig: dict) -> None:  # type: ignore[type-arg]
        bench("leds", sensor=SMALL)(rig)
        rig["devices"]["lamp"]["warm_up"] = "0 s"
        rig["optics"]["irradiance"] = str(tmp_path / "irradiance.yaml")

    run = record(tmp_path, keys | {"for": "10 s", "last_decay": "10 s"}, change)
    with pytest.raises(DataError, match="got none of '415 nm'"):
        process_run(run)
    part = part_of(run)
    assert next(frame.unit for frame in part.run.frames("band")) == "band-415 nm-1"


@pytest.mark.campaign
@pytest.mark.parametrize("excitation", ["steps", "smooth"])
@pytest.mark.parametrize(
    ("kind", "seed"), [("filters", 11), ("wheel", 12), ("monochromator", 13), ("leds", 14)]
)
def test_rates_are_the_rooms(kind: str, seed: int, excitation: str, tmp_path: Path) -> None:
    """The light is known; `tests.acceptance.selected_lights` measures it, too.

    Excitation is the same all over each band, which the fit does not assume, or falls smoothly.
    """
    rig: dict[str, dict[str, object]] = {
        "devices": {"lamp": {}},
        "simulation": {"sample": "blue-paint", "lvf": {}, "filters_bent": 0.01},
    }
    bench(kind, seed=seed)(rig)
    light = true_light(kind, Simulation.model_validate(rig["simulation"]))
    IRRADIANCE_KIND.write(tmp_path, light)
    sample: dict[str, object] = {"material": "blue-paint", "region": [0.03, 0.1, 0.94, 0.8]}
    sample["kinetics"] = {"excitation": excitation}
    run = recorded(tmp_path, kind, tmp_path / "irradiance.yaml", seed=seed, sample=[sample])
    result = process_run(run)
    assert isinstance(result, ExcitationResult)
    assert_read_back(result)
    (patch,) = result.patches.values()
    (state,) = patch.fit.states
    # The room's lamp is four times as bright as the irradiance to which Table 1's rates belong.
    (truth,) = 4 * true_rates()
    assert (np.abs(state.k_e_per_s - truth) < 3 * state.k_e_per_s_sigma + 1e-5).all()
    assert (state.k_e_per_s_sigma[:3] < [0.25, 0.2, 0.8] * truth[:3]).all()
    assert "excitation-uneven" in codes(result.warnings)
    assert patch.closure is not None
    assert patch.closure.rms_sigma < 3
