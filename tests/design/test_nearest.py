"""The measured material behind a glow is found again, alone or as one of two."""

import numpy as np
import pytest

from labrig.design import (
    Keys,
    LightProgramme,
    material_radiance,
    nearest_materials,
    presets,
    solve,
    spectral_bands,
    three_bands,
)
from labrig.foundation.errors import UsageError
from labrig.material import Material, State, read_material

EDGES_NM = np.linspace(400.0, 700.0, 9)
BANDS = spectral_bands(EDGES_NM)
#: A light of length 1, to which Table 1 belongs, for five minutes.
WHITE = np.full(8, 8**-0.5)
LIGHT = LightProgramme.checked([0.0, 300.0], [WHITE, np.zeros(8)])
TIMES_S = np.array([301.0, 310.0, 330.0, 400.0])


def keys_of(*parts: tuple[str, float]) -> Keys:
    radiance = sum(
        (
            share * material_radiance(read_material(name), LIGHT, 0, TIMES_S)
            for name, share in parts
        ),
        np.zeros((4, 8)),
    )
    return Keys.checked(0, TIMES_S, radiance)


@pytest.mark.parametrize("name", ["blue-paint", "green-paint", "pink-paint", "double-wide"])
def test_a_measured_material_is_nearest_to_its_own_glow(name: str) -> None:
    design = solve(LIGHT, keys_of((name, 2.5)), BANDS, albedo=0.4)
    one, two = nearest_materials(design)
    assert one.names == (name,)
    assert one.brightness == pytest.approx(2.5, rel=1e-6)
    assert one.delta_e2000.max() < 1e-6
    assert two is None


def test_two_side_by_side_are_found_with_their_areas_and_keep_their_states() -> None:
    keys = keys_of(("blue-paint", 0.3), ("red-paint", 0.9))
    design = solve(LIGHT, keys, BANDS, albedo=0.4)
    one, two = nearest_materials(design)
    assert two is not None
    assert dict(zip(two.names, two.fractions, strict=True)) == pytest.approx(
        {"blue-paint": 0.25, "red-paint": 0.75}, rel=1e-6
    )
    assert two.delta_e2000.max() < 1e-6 < one.delta_e2000.max()
    assert [state.k_r_per_s for state in two.material.states] == [
        state.k_r_per_s
        for name in ("blue-paint", "red-paint")
        for state in read_material(name).states
    ]
    glow = two.brightness * material_radiance(two.material, LIGHT, 0, TIMES_S)
    np.testing.assert_allclose(glow, keys.radiance, rtol=1e-6)


def test_of_own_materials_the_nearest_is_chosen() -> None:
    design = solve(LIGHT, keys_of(("blue-paint", 1.0)), BANDS, albedo=0.4)
    own = [read_material(name) for name in ("green-paint", "red-paint")]
    one, _ = nearest_materials(design, own)
    assert one.names[0] in ("green-paint", "red-paint")
    assert one.delta_e2000.mean() > 5


def test_three_channels_have_the_same_nearest() -> None:
    spectral = keys_of(("green-paint", 1.0))
    light = LightProgramme.checked([0.0, 300.0], [[1.0] * 3, [0.0] * 3])
    keys = Keys.checked(0, TIMES_S, spectral.radiance @ BANDS.to_rgb.T)
    one, _ = nearest_materials(solve(light, keys, three_bands(), albedo=0.4))
    assert one.names == ("green-paint",)


def test_presets_predict_a_glow_and_others_are_left_out() -> None:
    names = {material.name for material in presets()}
    assert {"blue-paint", "green-paint", "double-wide"} <= names
    assert not {"bottle", "gloves", "stickers"} & names


def test_materials_without_excitation_are_refused() -> None:
    bare = Material(name="bare", kind="phosphor", states=(State(k_r_per_s=0.1),))
    design = solve(LIGHT, keys_of(("blue-paint", 1.0)), BANDS, albedo=0.4)
    with pytest.raises(UsageError, match="excitation rates"):
        nearest_materials(design, [bare])
