"""Materials of a kinetic order: what the charge does not tell is not printed."""

from pathlib import Path

import pytest

from labrig.foundation.errors import UsageError
from labrig.material import (
    Material,
    compare_materials,
    read_material,
    write_material,
)
from labrig.report import comparison_table, describe_phosphor


def material(r0_sigma: float) -> Material:
    """Blue paint of order 1.5, r(0) = 0.25 known to `r0_sigma`."""
    blue = read_material("blue-paint")
    update = {
        "k_r_per_s": 0.04, "k_r_per_s_sigma": 0.002, "kinetic_order": 1.5,
        "kinetic_order_sigma": 0.01, "amplitude": 900.0, "amplitude_sigma": 9.0, "r0": 0.25,
        "r0_sigma": r0_sigma, "decay_time_s": 100.0, "decay_time_s_sigma": 3.0,
    }  # fmt: skip
    state = blue.states[0].model_copy(update=update)
    return blue.model_copy(update={"states": (state,)})


def cells(text: str) -> dict[str, str]:
    """First and second cell of every row."""
    rows = [line.strip().rsplit("  ", 1) for line in text.splitlines() if "  " in line.strip()]
    return {row[0].strip(): row[1].strip() for row in rows if len(row) == 2}


def test_tau_and_p_are_shown_with_their_charge(tmp_path: Path) -> None:
    known = cells(describe_phosphor(material(0.02)))
    assert known["τ / s"].startswith("100.0 ±")
    assert known["p"].startswith("3.000 ± 0.040")
    assert known["k_r / s⁻¹"].startswith("0.040")
    unknown = cells(describe_phosphor(material(0.2)))
    assert unknown["τ / s"] == known["τ / s"]
    assert {unknown[name] for name in ("k_r / s⁻¹", "r(0)")} == {"–"}
    assert {value for name, value in unknown.items() if name.startswith(("k_e", "Λ"))} == {"–"}
    path = tmp_path / "material.yaml"
    write_material(path, material(0.2))
    assert read_material(path) == material(0.2)
    path.write_text(path.read_text().replace("decay_time_s: 100.0", "decay_time_s: 90.0"))
    with pytest.raises(UsageError, match="decay_time_s"):
        read_material(path)


def test_what_is_not_known_is_not_compared() -> None:
    rows = {
        row[0]: row
        for row in comparison_table(compare_materials(material(0.2), material(0.02))).rows
    }
    assert rows["k_r / s⁻¹"][1] == "–"
    assert rows["τ / s"][3] == "0.0"
    assert all(row[1] == "–" for name, row in rows.items() if name.startswith("k_e"))


def test_what_is_at_its_bound_is_text_of_its_limit(tmp_path: Path) -> None:
    blue = read_material("blue-paint")
    assert blue.states[0].k_e_per_s is not None
    update = {
        "kinetic_order": 1.0, "kinetic_order_sigma": 0.02, "kinetic_order_limit_95": 1.0329,
        "r0": 1.0, "r0_sigma": 0.01, "k_e_per_s": (0.0, *(blue.states[0].k_e_per_s or ())[1:]),
        "k_e_per_s_sigma": (0.002,) * 8,
    }  # fmt: skip
    bounded = blue.model_copy(update={"states": (blue.states[0].model_copy(update=update),)})
    path = tmp_path / "material.yaml"
    write_material(path, bounded)
    assert read_material(path) == bounded
    shown = cells(describe_phosphor(read_material(path)))
    assert shown["kinetic order b"] == "< 1.033"
    assert shown["r(0)"] == "> 0.984"
    k_e = [value for name, value in shown.items() if name.startswith("k_e")]
    assert k_e[0] == "< 0.0033"
    zero = [value == 0 for value in bounded.states[0].k_e_per_s or ()]
    assert [value.startswith("<") for value in k_e] == zero
    assert "kinetic order b" not in cells(describe_phosphor(blue))
