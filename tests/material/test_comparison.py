"""A material beside another: scales do not count, everything else does."""

from typing import Any

import pytest
from hypothesis import given, strategies as st

from labrig.compare.nalbach2017 import TABLE_1
from labrig.foundation import resources
from labrig.material import IrradianceNorm, Material, State, compare_materials, read_material
from labrig.report.material_tables import comparison_table

NAMES = sorted(resources.names("config/materials"))
factors = st.floats(1e-3, 1e3)


def rescaled(material: Material, of_k_e: float, of_reradiation: float) -> Material:
    """The same material, its E shorter by `of_k_e` and its Λ in another unit."""
    norm = material.irradiance_norm
    return material.model_copy(
        update={
            "irradiance_norm": norm
            and IrradianceNorm(kind="vector_length", value=norm.value / of_k_e),
            "states": tuple(
                state.model_copy(
                    update={
                        "k_e_per_s": state.k_e_per_s and tuple(of_k_e * k for k in state.k_e_per_s),
                        "reradiation": state.reradiation
                        and tuple(of_reradiation * value for value in state.reradiation),
                    }
                )
                for state in reversed(material.states)
            ),
        }
    )


@given(st.sampled_from(NAMES), factors, factors)
def test_a_material_beside_itself_does_not_deviate(
    name: str, of_k_e: float, of_reradiation: float
) -> None:
    material = read_material(name)
    found = compare_materials(rescaled(material, of_k_e, of_reradiation), material)
    assert found.pairs
    for pair in found.pairs:
        assert pair.measured == pytest.approx(pair.reference, rel=1e-9, abs=1e-15)
    assert found.reradiation_factor == pytest.approx(1 / of_reradiation, rel=1e-9)
    if material.irradiance_norm:
        assert found.k_e_factor == pytest.approx(1 / of_k_e, rel=1e-9)
    assert {row[3] for row in comparison_table(found).rows} <= {"0.0", "–"}


def measured(**changed: Any) -> Material:
    """Blue paint with uncertainties, Λ in units of a tenth."""
    blue = read_material("blue-paint")
    state = blue.states[0].model_dump() | {
        "k_r_per_s": 0.0328,
        "k_r_per_s_sigma": 0.0004,
        "reradiation": tuple(10 * value for value in blue.states[0].reradiation or ()),
        "reradiation_sigma": (1.0,) * 8,
    }
    return blue.model_copy(update={"states": (State(**(state | changed)),)})


def test_deviations_stand_in_percent_and_sigma() -> None:
    table = comparison_table(compare_materials(measured(), read_material("blue-paint")))
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["k_r / s⁻¹"] == ("0.03280 ± 0.00040", "0.032", "+2.5", "+2.0")
    assert rows["Λ 437.5–475 nm"] == ("4.37 ± 0.10", "4.37", "0.0", "0.0")
    assert rows["k_e 400–437.5 nm / s⁻¹"] == ("0.017", "0.017", "0.0", "–")
    assert rows["k_e 662.5–700 nm / s⁻¹"][2:] == ("–", "–"), "0 has no per cent"
    assert "multiplied by 0.1," in table.caption
    assert all(len(row) == len(table.head) for row in table.rows)


def test_what_was_not_measured_is_reported() -> None:
    decay_only = Material(
        name="test", kind="phosphor", states=(State(k_r_per_s=0.03), State(k_r_per_s=0.3))
    )
    found = compare_materials(decay_only, read_material("blue-paint"))
    said = " ".join(found.notes)
    assert "k_e was not measured" in said
    assert "Λ was not measured" in said
    assert "2 states" in said
    assert [pair.quantity for pair in found.pairs] == ["k_r 1", "k_r 2"]
    other_bands = measured().model_copy(update={"bands_nm": tuple(range(400, 490, 10))})
    assert "bands differ" in " ".join(
        compare_materials(other_bands, read_material("blue-paint")).notes
    )


def test_other_orders_are_said() -> None:
    found = compare_materials(measured(kinetic_order=1.6), read_material("blue-paint"))
    assert [pair.quantity for pair in found.pairs][:2] == ["k_r", "b"]
    assert (found.pairs[1].measured, found.pairs[1].reference) == (1.6, 1.0)
    assert any("kinetic orders differ" in note for note in found.notes)


def test_the_materials_of_table_1_are_shipped() -> None:
    assert len(TABLE_1) == 11
    assert set(TABLE_1) <= set(NAMES)
