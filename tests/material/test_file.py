"""The material file: what it takes, what it refuses, and that it survives being written."""

from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.material.file import (
    Albedo,
    IrradianceNorm,
    Material,
    Provenance,
    RadianceFactor,
    ScaleFactor,
    Spectrum,
    State,
    read_material,
    write_material,
)

TABLE_1 = (
    "blue-paint green-paint orange-paint pink-paint purple-paint red-paint white-paint "
    "yellow-paint bottle gloves stickers"
)

positive = st.floats(1e-12, 1e12)
not_negative = st.floats(0, 1e12)


def series(length: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.lists(not_negative, min_size=length, max_size=length).map(tuple)


def rising(least: int) -> st.SearchStrategy[tuple[float, ...]]:
    return st.lists(positive, min_size=least, max_size=6, unique=True).map(sorted).map(tuple)


@st.composite
def materials(draw: st.DrawFn) -> Material:
    edges = draw(rising(2))
    bands = len(edges) - 1
    states = []
    for _ in range(draw(st.integers(1, 3))):
        k_e = draw(st.none() | series(bands))
        states.append(
            State(
                k_r_per_s=draw(positive),
                k_r_per_s_sigma=draw(st.none() | not_negative),
                kinetic_order=draw(st.just(1.0) | st.floats(1.001, 4)),
                r0=draw(st.none() | st.floats(0, 1)),
                k_e_per_s=k_e,
                k_e_per_s_sigma=None if k_e is None else draw(st.none() | series(bands)),
                reradiation=draw(st.none() | series(bands)),
            )
        )
    wavelength_nm = draw(rising(2))
    count = len(wavelength_nm)
    fractions = st.lists(st.floats(0, 1.2), min_size=count, max_size=count).map(tuple)
    factor = st.builds(
        ScaleFactor,
        name=st.just("card's radiance over irradiance"),
        value=positive,
        sigma=st.none() | not_negative,
        unit=st.sampled_from(["1", "1/sr"]),
    )
    scale = draw(st.none() | st.sampled_from(["relative", "absolute"]))
    return Material(
        name=draw(st.text(min_size=1).filter(lambda name: name.isprintable())),
        kind="phosphor",
        bands_nm=edges,
        irradiance_norm=IrradianceNorm(kind="vector_length", value=draw(positive)),
        states=tuple(states),
        spectrum=draw(
            st.none()
            | series(len(wavelength_nm)).map(
                lambda value: Spectrum(wavelength_nm=wavelength_nm, value=value)
            )
        ),
        scale=scale,
        scale_factors=() if scale is None else draw(st.lists(factor, max_size=3).map(tuple)),
        albedo=draw(
            st.none()
            | st.builds(
                Albedo,
                wavelength_nm=st.just(wavelength_nm),
                value=fractions,
                sigma=st.none() | series(count),
                common_sigma=st.none() | not_negative,
            )
        ),
        radiance_factor=draw(
            st.none()
            | st.builds(
                RadianceFactor,
                lamp=st.just("halogen"),
                wavelength_nm=st.just(wavelength_nm),
                value=series(count),
                sigma=st.none() | series(count),
            )
        ),
        thickness_mm=draw(st.none() | positive),
        mass_per_area_g_per_m2=draw(st.none() | positive),
        provenance=draw(st.none() | st.builds(Provenance, source=st.text("αb: #'\n-9"))),
    )


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(material=materials())
def test_written_and_read_is_the_same(material: Material, tmp_path: Path) -> None:
    path = tmp_path / "sample.yaml"
    write_material(path, material)
    assert read_material(path) == material


def test_the_first_order_is_not_written(tmp_path: Path) -> None:
    path = tmp_path / "sample.yaml"
    for order in (1.0, 1.5):
        state = State(k_r_per_s=0.1, kinetic_order=order, kinetic_order_sigma=0.1)
        write_material(path, Material(name="x", kind="phosphor", states=(state,)))
        assert ("kinetic_order" in path.read_text()) == (order != 1)
        assert read_material(path).is_first_order == (order == 1)


@pytest.mark.parametrize("name", list(resources.names("config/materials")))
def test_shipped_materials_are_complete(name: str) -> None:
    material = read_material(name)
    assert material.name == name
    assert material.provenance is not None
    assert all(state.reradiation is not None for state in material.states)


def test_table_1_is_shipped() -> None:
    assert set(TABLE_1.split()) <= set(resources.names("config/materials"))
    blue = read_material("blue-paint")
    assert blue.bands_nm == pytest.approx([400 + 37.5 * i for i in range(9)])
    (state,) = blue.states
    assert state.k_r_per_s == 0.032
    assert list(state.k_e_per_s or ()) == [0.017, 0.05, 0.004, 0, 0, 0, 0, 0]
    assert list(state.reradiation or ()) == [0.34, 4.37, 3.65, 0.55, 0, 0.01, 0, 0]
    unmeasured = {n for n in TABLE_1.split() if read_material(n).states[0].k_e_per_s is None}
    assert unmeasured == {"bottle", "gloves", "stickers"}


def test_double_exponentials_span_the_ratios() -> None:
    doubles = [
        read_material(n) for n in resources.names("config/materials") if n.startswith("double-")
    ]
    rates = [[state.k_r_per_s for state in material.states] for material in doubles]
    assert sorted(round(fast / slow, 6) for fast, slow in rates) == [2.5, 2.5, 5, 5, 20, 20]
    assert max(1 / slow for _, slow in rates) > 180
    assert all(fast > slow for pair in rates for fast, slow in pairwise(pair))
    assert all(s.k_e_per_s is not None for material in doubles for s in material.states)


WHOLE = {
    "name": "x",
    "kind": "phosphor",
    "bands_nm": [400, 500, 600],
    "irradiance_norm": {"kind": "vector_length", "value": 1.0},
    "states": [{"k_r_per_s": 0.1, "k_e_per_s": [0.1, 0.2], "reradiation": [1.0, 2.0]}],
}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("states: [{k_r_per_s: 0.1, reradiation: [1.0]}]", "expected 2 values, one for each band"),
        ("states: [{k_r_per_s: 0}]", "greater than 0, got '0'"),
        ("states: [{k_r_per_s: .inf}]", "finite number"),
        ("states: [{k_r_per_s: 0.1, k_e_pers: [1.0]}]", "did you mean 'k_e_per_s'?"),
        ("states: [{k_r_per_s: 0.1, r0_sigma: 0.1}]", "expected 'r0' beside 'r0_sigma'"),
        (
            "states: [{k_r_per_s: 0.1, reradiation: [1, 2], reradiation_sigma: [1]}]",
            "expected 2 values in 'reradiation_sigma' as in 'reradiation', got 1",
        ),
        ("states: [{k_r_per_s: 0.1, kinetic_order: 0.5}]", "kinetic_order"),
        (
            "states: [{k_r_per_s: 0.1, kinetic_order: 2, amplitude: 5}]",
            "expected 'r0' above 0 beside 'amplitude' of a state with 'kinetic_order'",
        ),
        ("states: []", "at least 1 value"),
        ("bands_nm: [500, 400, 600]", "rising wavelengths in 'bands_nm'"),
        ("bands_nm: null", "expected 0 values"),
        ("irradiance_norm: null", "expected 'irradiance_norm' beside states.0.k_e_per_s"),
        ("spectrum: {wavelength_nm: [400, 500], value: [1]}", "expected 2 numbers in 'value'"),
        ("kind: fluorescent", "'phosphor', got 'fluorescent'"),
        ("albedo: {wavelength_nm: [400, 500], value: [1]}", "at least 2"),
        ("albedo: {wavelength_nm: [500, 400], value: [1, 1]}", "rising wavelengths"),
        (
            "albedo: {wavelength_nm: [400, 500], value: [1, 2]}",
            "of at most 1.2, got '2'",
        ),
        (
            "radiance_factor: {lamp: x, wavelength_nm: [400, 500], value: [1, 1], sigma: [1]}",
            "expected 2 numbers in 'sigma'",
        ),
        ("scale: lux", "scale"),
        ("scale_factors: [{name: x, value: 2}]", "expected 'scale' beside 'scale_factors'"),
        ("thickness_mm: 0", "greater than 0"),
    ],
)
def test_refusals_say_what_was_expected(change: str, said: str, tmp_path: Path) -> None:
    key = change.partition(":")[0]
    lines = [f"{name}: {value}" for name, value in WHOLE.items() if name != key]
    path = tmp_path / "sample.yaml"
    path.write_text("\n".join([*lines, change]).replace("'", ""), encoding="utf-8")
    with pytest.raises(UsageError) as refusal:
        read_material(path)
    assert said in str(refusal.value)
    assert str(path) in str(refusal.value)


def test_excitation_rates_of_an_absolute_material_are_per_irradiance() -> None:
    whole = {**WHOLE, "irradiance_norm": None, "scale": "absolute"}
    assert Material.model_validate(whole).irradiance_norm is None


def test_unknown_name_gets_a_suggestion() -> None:
    with pytest.raises(UsageError, match="did you mean 'blue-paint'"):
        read_material("blu-paint")
    with pytest.raises(UsageError, match="no such material file"):
        read_material("mine.yaml")


def test_a_bare_word_is_the_shipped_one_whatever_lies_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_material(tmp_path / "bottle", read_material("gloves"))
    write_material(tmp_path / "bottle.yaml", read_material("gloves"))
    monkeypatch.chdir(tmp_path)
    assert read_material("bottle").name == "bottle"
    assert read_material("bottle.yaml").name == "gloves"
