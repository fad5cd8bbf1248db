"""Scenes over time: what is charged by which light, and how it then glows."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labrig.errors import UsageError
from labrig.material import Material, State, read_material, write_material
from labrig.optics import absolute_irradiance, read_light
from labrig.reproduce import Assumptions, Renderer, Scene, SceneFile, build_scene, load_scene
from labrig.yaml_file import write_yaml

LUX = 800.0
MIRROR = {"wavelength_nm": [400, 500], "value": [1, 1]}
SUN = {"kind": "distant", "irradiance_w_per_m2": 1, "towards": [0, 0, 1]}
BENCH = {"spectrum": "A", "illuminance_lux": 1000.0}


def scene(folder: Path, **changed: Any) -> Scene:
    """A phosphorescent square under a distant lamp that shines for five minutes."""
    content: dict[str, Any] = {
        "name": "square",
        "kind": "scene",
        "bench_light": BENCH,
        "materials": {"paint": {"file": "blue-paint", "assume_albedo": 0.6, "assume_scale": 0.5}},
        "lamps": {"sun": {"kind": "distant", "illuminance_lux": LUX, "towards": [0, 0, 1]}},
        "objects": {
            "square": {
                "material": "paint",
                "rectangle": {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]},
                "samples": [4, 4],
            }
        },
        "camera": {
            "position_m": [0.5, 0.5, 3], "look_at_m": [0.5, 0.5, 0], "up": [0, 1, 0],
            "vertical_fov_deg": 15, "width_px": 4, "height_px": 4,
        },
        "programme": [{"at_s": -300, "lamps": {"sun": 1}}, {"at_s": 0, "lamps": {"sun": 0}}],
        "frames_s": [-1, 0, 10, 60],
        "paths": {"per_pixel": 16, "per_place": 16},
    }  # fmt: skip
    return build_scene(SceneFile.model_validate({**content, **changed}), folder)


def kappa_of(material: Material, lux: float) -> np.ndarray[Any, Any]:
    """Return κ of each state under so many lux of D65, by integrals of its own."""
    edges = np.array(material.bands_nm)
    nm = np.arange(edges[0], edges[-1], 0.01) + 0.005
    band = np.searchsorted(edges, nm) - 1

    def irradiance(spectrum: str, illuminance_lux: float) -> np.ndarray[Any, Any]:
        light = absolute_irradiance(illuminance_lux, read_light(spectrum))
        return np.bincount(band, light.at(nm) * 0.01)

    unit = np.linalg.norm(irradiance("A", 1000.0))
    assert all(state.k_e_per_s for state in material.states)
    k_e = np.array([state.k_e_per_s for state in material.states])
    return np.asarray(k_e @ irradiance("D65", lux) / unit)


@pytest.mark.parametrize("name", ["blue-paint", "pink-paint", "yellow-paint"])
def test_a_square_is_charged_and_glows_as_the_rate_equation_says(tmp_path: Path, name: str) -> None:
    """The only approximation is that spectra are constant in a band of 20 nm."""
    material = read_material(name)
    entry = {"paint": {"file": name, "assume_albedo": 0.6, "assume_scale": 0.5}}
    frames = list(Renderer(scene(tmp_path, materials=entry)).frames())
    kappa, k_r = kappa_of(material, LUX), np.array([each.k_r_per_s for each in material.states])
    r_0 = kappa / (kappa + k_r) * -np.expm1(-(kappa + k_r) * 300)
    edges = np.array(material.bands_nm)
    bench = absolute_irradiance(1000.0, read_light("A")).in_bands(edges[[0, -1]])[0] * 0.5
    reradiation = np.array([each.reradiation for each in material.states])
    for frame in frames[1:]:
        r = r_0 * np.exp(-k_r * frame.t_s)
        band_w = bench * (k_r * r) @ reradiation @ np.diff(edges)
        seen = frame.radiance.reshape(-1, 24).mean(axis=0).sum() * 20.0
        assert seen == pytest.approx(band_w, rel=0.01)
    # While the lamp shines, the reflected light is seen, too.
    reflected = absolute_irradiance(LUX, read_light("D65")).in_bands(np.arange(300, 781, 20.0))
    light = frames[0].radiance.mean(axis=(0, 1)) - 0.6 / np.pi * reflected
    assert 0 < light.sum() * 20 < 1.01 * bench * (k_r * r_0) @ reradiation @ np.diff(edges)


def test_glow_charges_another_phosphor_in_the_dark(tmp_path: Path) -> None:
    """Two squares face each other: one is full at first, the other empty, and no lamp shines."""
    square = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]}
    facing = {"corner_m": [0, 0, 0.5], "edge_u_m": [0, 1, 0], "edge_v_m": [1, 0, 0]}
    phosphor = {"file": str(tmp_path / "uv.yaml"), "assume_albedo": 0.0, "assume_scale": 1.0}
    write_material(
        tmp_path / "uv.yaml",
        Material(
            name="uv",
            kind="phosphor",
            bands_nm=(400.0, 440.0, 480.0),
            irradiance_norm={"kind": "vector_length", "value": 1.0},
            states=(State(k_r_per_s=0.02, k_e_per_s=(1.0, 0.0), reradiation=(40.0, 0.0)),),
        ),
    )
    built = scene(
        tmp_path,
        materials={"full": {**phosphor, "levels": 1.0}, "empty": phosphor},
        lamps={},
        objects={
            "below": {"material": "full", "rectangle": square, "samples": [1, 1]},
            "above": {"material": "empty", "rectangle": facing, "samples": [1, 1]},
        },
        programme=[{"at_s": 0, "lamps": {}}],
        frames_s=[0, 30, 120],
        paths={"per_pixel": 4, "per_place": 16384, "vertices": 4, "survival": 0.0},
    )
    renderer = Renderer(built)
    # View factor of two unit squares 0.5 m apart.
    view_factor = 0.41525
    edges = np.array([400.0, 440.0, 480.0])
    bench = absolute_irradiance(1000.0, read_light("A"))
    unit = float(np.linalg.norm(bench.in_bands(edges) * 40))
    mean = float(bench.in_bands(edges[[0, 2]])[0])
    # κ of one by the level of the other: E = π F L, over 40 nm.
    c = np.pi * view_factor * mean * 40.0 * 0.02 * 40.0 / unit

    def growth(_: float, r: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return np.asarray((1 - r) * c * r[::-1] - 0.02 * r)

    truth = solve_ivp(growth, (0, 120), [1.0, 0.0], rtol=1e-9, t_eval=[30, 120]).y
    for at, t_s in enumerate((30.0, 120.0)):
        renderer.frame(t_s)
        levels = [float(renderer.levels[name][0, 0]) for name in ("full", "empty")]
        np.testing.assert_allclose(levels, truth[:, at], rtol=0.015)


def test_it_goes_on_from_levels_that_were_kept(tmp_path: Path) -> None:
    built = scene(tmp_path)
    first = Renderer(built)
    first.frame(0.0)
    again = Renderer(built)
    again.restore(first.t_s, first.levels)
    for t_s in (10.0, 60.0):
        np.testing.assert_array_equal(first.frame(t_s).radiance, again.frame(t_s).radiance)


def test_states_ride_on_a_surface_that_moves(tmp_path: Path) -> None:
    """A wave under a lamp from above: levels lie where the surface was lit, and stay with it."""
    flat = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0], "parts": 16}
    wave = {"amplitude_m": 0.05, "period_s": 40.0}
    moving = {"material": "paint", "rectangle": flat, "wave": wave}
    levels = {}
    for samples in ([16, 2], "vertices"):
        built = scene(
            tmp_path,
            objects={"square": {**moving, "samples": samples}},
            programme=[{"at_s": -20, "lamps": {"sun": 1}}, {"at_s": 0, "lamps": {"sun": 0}}],
            frames_s=[0],
            step_s=2.5,
            paths={"per_pixel": 1, "per_place": 64},
        )
        assert built.is_moving
        renderer = Renderer(built)
        renderer.frame(0.0)
        levels[str(samples)] = renderer.levels["paint"][0]
    along = levels["[16, 2]"].reshape(2, 16).mean(axis=0)
    # The slope is lit less than crest and trough, and those move on by half a wave.
    assert np.ptp(along) > 0.005 * along.mean()
    of_vertices = levels["vertices"].reshape(17, 17).mean(axis=0)
    np.testing.assert_allclose((of_vertices[1:] + of_vertices[:-1]) / 2, along, rtol=0.02)


def test_levels_at_first_are_given_or_those_of_the_light(tmp_path: Path) -> None:
    paint = {"file": "blue-paint", "assume_albedo": 0.6, "assume_scale": 0.5}
    for levels, frame_s in ((0.25, -300.0), ("charged", -300.0)):
        renderer = Renderer(scene(tmp_path, materials={"paint": {**paint, "levels": levels}}))
        renderer.frame(frame_s)
        kappa = kappa_of(read_material("blue-paint"), LUX)
        expected = 0.25 if levels == 0.25 else kappa / (kappa + 0.032)
        np.testing.assert_allclose(renderer.levels["paint"], expected * np.ones((1, 16)), rtol=0.01)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"materials": {"paint": {"file": "blue-paint"}}}, "labrig run reflectance"),
        (
            {"materials": {"paint": {"file": "blue-paint", "assume_albedo": 0.5}}},
            "--assume-scale",
        ),
        ({"materials": {"paint": {"albedo": MIRROR}}}, "eigenvalue"),
        ({"lamps": {"sun": {"spectrum": "900nm", **SUN}}}, "between 300 and 780 nm"),
        ({"bands": {"first_nm": 710, "last_nm": 780, "count": 4}}, "overlap"),
        ({"camera": {"position_m": [0, 0, 1], "look_at_m": [0, 0, 0]}}, "upwards"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(tmp_path: Path, changed: dict[str, Any], says: str) -> None:
    with pytest.raises(UsageError, match=says) as raised:
        Renderer(scene(tmp_path, **changed)).frame(0.0)
    assert "\n" not in str(raised.value)


OBJ = """
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 2 3 4
f 1 4 3
"""


@pytest.mark.parametrize(
    ("text", "mesh", "entry", "says"),
    [
        (OBJ, {}, {"samples": [8, 8]}, "texture coordinates"),
        (OBJ.replace("f 1 4 3", ""), {}, {}, "holes"),
        (
            OBJ.replace("1 3 2", "1 2 3")
            .replace("1 2 4", "1 4 2")
            .replace("2 3 4", "2 4 3")
            .replace("1 4 3", "1 3 4"),
            {},
            {},
            "inverted",
        ),
        ("v 0 0 0\n", {}, {}, "triangles"),
        ("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", {}, {"two_sided": True}, "area"),
        ("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", {}, {"two_sided": True}, "finite"),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
            "f 1/1 2/2 3/3\nf 1/1 2/2 4/3\n",
            {},
            {"two_sided": True, "samples": [8, 8]},
            "two triangles",
        ),
    ],
)
def test_a_mesh_that_does_not_fit_is_one_line(
    tmp_path: Path, text: str, mesh: dict[str, Any], entry: dict[str, Any], says: str
) -> None:
    (tmp_path / "a.obj").write_text(text)
    thing = {"material": "paint", "mesh": {"file": "a.obj", **mesh}, **entry}
    with pytest.raises(UsageError, match=says) as raised:
        Renderer(scene(tmp_path, objects={"thing": thing})).frame(0.0)
    assert "\n" not in str(raised.value)


def test_a_mesh_is_placed_and_has_states_at_its_vertices(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    thing = {
        "material": "paint",
        "mesh": {"file": "a.obj", "size_m": 0.5, "turned_deg": [0, 0, 90]},
    }
    renderer = Renderer(scene(tmp_path, objects={"thing": thing}))
    renderer.frame(0.0)
    assert renderer.levels["paint"].shape == (1, 4)
    assert renderer.levels["paint"].max() > 0.1


def test_materials_are_replaced_and_assumptions_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="phosphorescent"):
        load_scene("cornell-box", {"phosphoresent": "blue-paint"})
    built = load_scene(
        "cornell-box", {"phosphorescent": "pink-paint"}, Assumptions(albedo=0.5, scale=1.0)
    )
    assert any("pink-paint" in note and "0.7" in note for note in built.notes)


@pytest.mark.parametrize("name", sorted(p.stem for p in Path("config/scenes").glob("*.yaml")))
def test_shipped_scenes_are_rendered(name: str) -> None:
    built = load_scene(name).resized(12, 9, 4)
    if built.is_moving:
        built = built.at_times(built.file.frames_s[:2])
    for frame in Renderer(built, threads=1).frames():
        assert frame.radiance.shape == (9, 12, 24)
        assert np.isfinite(frame.radiance).all()
        assert frame.radiance.max() > 0


def test_a_scene_file_is_read_back(tmp_path: Path) -> None:
    file = scene(tmp_path).file
    write_yaml(tmp_path / "scene.yaml", file)
    assert load_scene(tmp_path / "scene.yaml").file == file
