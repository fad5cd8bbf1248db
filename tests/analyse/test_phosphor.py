"""A chain of protocols: each part alone in its own eyes, one material at the end."""

import json
from pathlib import Path

import pytest

from labrig.acquire import read_protocol
from labrig.calibration import (
    IRRADIANCE_KIND,
    REFLECTANCE_KIND,
    PatchReflectance,
    ReflectanceFile,
)
from labrig.foundation.errors import UsageError
from labrig.foundation.number_format import plus_minus
from labrig.material import read_material
from labrig.process import process_and_report
from labrig.protocols.phosphor.result import PhosphorResult
from labrig.record import read_run
from labrig.results import ResultWithDecays
from tests.analyse.excitation.bench import QUICK, true_irradiance
from tests.analyse.recorded import cut_off_and_resumed, record
from tests.quick_yaml import write_quickly
from tests.results.made import assert_read_back

WIDTH, HEIGHT = 192, 48
DECAY = {
    "protocol": "decay", "charge": "5 min", "first": "1 s", "every": "4 s", "for": "80 s",
    "daylight": False,
}  # fmt: skip
SHORT = {key: value for key, value in QUICK.items() if key != "sample"} | {
    "at_most": 2, "refine": 0, "direct": ["10 s", "4 min"]
}  # fmt: skip


GREY = PatchReflectance(
    wavelength_nm=(400, 700), albedo=(0.3, 0.4), albedo_sigma=(0.01, 0.01),
    radiance_factor=(0.3, 0.4), radiance_factor_sigma=(0.01, 0.01), common_sigma=0.01,
)  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("phosphor")
    IRRADIANCE_KIND.write(folder, true_irradiance(WIDTH, HEIGHT))
    REFLECTANCE_KIND.write(folder, ReflectanceFile(lamp="halogen", patches={"": GREY}))

    def change(rig: dict[str, dict[str, object]]) -> None:
        rig["optics"]["irradiance"] = str(folder / "irradiance.yaml")
        rig["optics"]["reflectance"] = str(folder / "reflectance.yaml")
        rig["simulation"]["sensor"] = {"width": WIDTH, "height": HEIGHT}

    chain = {"protocol": "phosphor", "sample": {"name": "blue-paint"}, "parts": [DECAY, SHORT]}
    made = record(folder, chain, change)
    cut, resumed = cut_off_and_resumed(made, "excitation/strip-1")
    assert list(cut.completed())[-1] == "excitation/strip-meter"
    assert list(resumed.completed())[-1] == "excitation/direct-2"
    return made


def test_a_chain_that_was_killed_and_resumed_ends_in_one_material(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Profiles of the rates, and a layer of the sample, are those of an excitation run by itself.
    monkeypatch.setattr("labrig.fit.excitation.fit.excitation_intervals", lambda *_: {})
    monkeypatch.setattr("labrig.protocols.excitation.analysis.orders.layer_effect", lambda *_: None)
    processed = process_and_report(run)
    result = processed.result
    assert isinstance(result, PhosphorResult)
    assert list(result.parts) == ["decay", "excitation"]
    material = read_material(run / "result" / "material.yaml")
    (state,) = material.states
    assert material.provenance is not None
    assert material.provenance.temperature_c == pytest.approx(21, abs=1)
    assert state.k_r_per_s == pytest.approx(0.032, rel=0.02)
    # Each part's material has the albedo that the rig file names, and so has the chain's.
    for name in ("material.yaml", "decay/material.yaml", "excitation/material.yaml"):
        albedo = read_material(run / "result" / name).albedo
        assert albedo is not None
        assert albedo.value == GREY.albedo
    assert state.k_e_per_s is not None
    assert state.k_e_per_s_sigma is not None
    assert state.k_e_per_s[1] / 4 == pytest.approx(0.05, rel=0.2)
    assert (run / "result" / "decay" / "series.csv").is_file()
    fit = json.loads((run / "result" / "decay" / "fit.json").read_text())
    assert fit["states"][0]["k_r_per_s"] == pytest.approx(0.032, rel=0.02)
    page = (run / "result" / "report.html").read_text()
    # As measured on top, rescaled to the paper in a section of its own.
    before, _, after = page.rpartition("Compared with a reference")
    k_e, k_e_sigma = state.k_e_per_s[1], state.k_e_per_s_sigma[1]
    assert plus_minus(k_e, k_e_sigma) in before
    assert "beside blue-paint of Nalbach" in after.replace("Beside", "beside")
    assert any(line.startswith("excitation: closure") for line in processed.lines)
    assert_read_back(result)
    # A part is fitted again by itself, with what the parts before it measured.
    decay = result.parts["decay"]
    assert decay.refit().to_json() == decay.to_json()
    two = decay.refit(states=2)
    assert isinstance(two, ResultWithDecays)
    assert [fit.n_states for fit in two.fits.values()] == [2]


def test_parts_see_their_own_frames_only(run: Path) -> None:
    whole = read_run(run)
    decay, excitation = whole.part("decay"), whole.part("excitation")
    assert {frame.unit for frame in decay.frames("dark")} == {"dark"}
    assert len(decay.frames("dark")) + len(excitation.frames("dark")) == len(whole.frames("dark"))
    assert not decay.frames("strip")


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ([DECAY, DECAY], "every protocol once"),
        ([{"charge": "5 min"}], "expected 'protocol: NAME' in every part"),
        ([{"protocol": "phosphor", "parts": []}], "expected 'protocol: NAME' in every part"),
        ([{"protocol": "decai"}], "did you mean 'decay'"),
        ([DECAY | {"evry": "5 s"}], "did you mean 'every'"),
        ([], "parts"),
    ],
)
def test_a_chain_that_cannot_be_is_one_clear_line(
    parts: list[dict[str, object]], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "chain.yaml"
    path.write_text(write_quickly({"protocol": "phosphor", "parts": parts}))
    with pytest.raises(UsageError) as caught:
        read_protocol(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
