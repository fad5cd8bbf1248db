"""Scenes over time: what is charged by which light, and how it then glows."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import write_yaml
from labrig.material import Material, State, read_material, write_material
from labrig.optics import absolute_irradiance, read_light
from labrig.reproduce import (
    Assumptions,
    Mesh,
    Renderer,
    load_scene,
    read_mesh,
)
from tests.reproduce.small_scenes import LUX, kappa_of, scene
from tests.warned import codes, of_code

PAINT = {"file": "blue-paint", "assume_albedo": 0.6}
HUGE = {"width_px": 8192, "height_px": 8192}
MIRROR = {"wavelength_nm": [400, 500], "value": [1, 1]}
SUN = {"kind": "distant", "irradiance_w_per_m2": 1, "towards": [0, 0, 1]}
SKY = {"kind": "sky", "luminance_cd_per_m2": 1}
FLAT = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]}
MANY = {**FLAT, "parts": 16}
DISK = {"centre_m": [0, 0, 0], "normal": [0, 0, 0], "radius_m": 1}
WAVE = {"amplitude_m": 0.05, "period_s": 40.0}


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
            states=(State(k_r_per_s=0.02, k_e_per_s=(1.0, 0.0), reradiation=(0.4, 0.0)),),
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
    c = np.pi * view_factor * mean * 0.4 * 0.02 * 40.0 / unit

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
        ({"lamps": {"sun": {"spectrum": "none.csv", **SUN}}}, "none.csv: no such file"),
        ({"lamps": {"sun": {"spectrum": "D66", **SUN}}}, "D65"),
        ({"lamps": {"sun": {"spectrum": "dark.csv", **SUN}}}, "without light"),
        ({"lamps": {"sun": {"spectrum": "negative.csv", **SUN}}}, "negative one at 510 nm"),
        (
            {"materials": {"paint": {**PAINT, "assume_scale": 500.0}}},
            "less light than it takes",
        ),
        ({"bands": {"first_nm": 710, "last_nm": 780, "count": 4}}, "overlap"),
        ({"camera": {"position_m": [0, 0, 1], "look_at_m": [0, 0, 0]}}, "upwards"),
        (
            {
                "camera": {**HUGE, "position_m": [0, 0, 1], "look_at_m": [0, 1, 0]},
                "paths": {"per_pixel": 65536},
            },
            "GB",
        ),
        (
            {
                "objects": {
                    "square": {"material": "paint", "rectangle": FLAT, "samples": [8192, 8192]}
                },
                "paths": {"per_place": 16384},
            },
            "GB",
        ),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_one_line(tmp_path: Path, changed: dict[str, Any], says: str) -> None:
    (tmp_path / "dark.csv").write_text("wavelength_nm,value\n400,0\n700,0\n")
    (tmp_path / "negative.csv").write_text("wavelength_nm,value\n400,9\n510,-1\n700,9\n")
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
        (OBJ.replace("f 1 4 3", "f 1 3 4"), {}, {}, "some inverted"),
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
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\nf 1 2 4\n",
            {},
            {"two_sided": True},
            "on some",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
            "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1//1 2//1 4//1\n",
            {},
            {"two_sided": True},
            "on some",
        ),
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
    assumed = of_code(built.notes, "albedo-assumed")
    assert "phosphorescent (pink-paint)" in assumed.subject
    assert assumed.values["albedo"] == 0.5


@pytest.mark.parametrize("name", sorted(p.stem for p in Path("config/scenes").glob("*.yaml")))
def test_shipped_scenes_are_rendered(name: str) -> None:
    built = load_scene(name).resized(12, 9, 2)
    if built.is_moving:
        built = built.at_times(built.file.frames_s[:1])
    for frame in Renderer(built, threads=1).frames():
        assert frame.radiance.shape == (9, 12, len(built.bands))
        assert np.isfinite(frame.radiance).all()
        assert frame.radiance.max() > 0


def test_a_scene_file_is_read_back(tmp_path: Path) -> None:
    file = scene(tmp_path).file
    write_yaml(tmp_path / "scene.yaml", file)
    assert load_scene(tmp_path / "scene.yaml").file == file


@pytest.mark.parametrize("missing", ["embreex", "numba"])
def test_without_the_extra_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    for name in list(sys.modules):
        if name.split(".")[0] == missing or name.endswith("kernels"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(UsageError, match=r"pip install 'labrig\[render\]'"):
        Renderer(scene(tmp_path)).frame(0.0)


def test_how_closed_a_mesh_is() -> None:
    sphere, box = Mesh.sphere((1, 2, 3), 0.5, rows=12), Mesh.box((0, 0, 0), (1, 2, 3), 30)
    for mesh, volume in ((sphere, None), (box, 6.0), (box.turned_over(), -6.0)):
        assert mesh.is_closed
        assert volume is None or mesh.volume_m3 == pytest.approx(volume)
    assert 0.9 < sphere.volume_m3 / (np.pi / 6) < 1
    drops = Mesh.octahedra([[0, 0, 0], [5, 0, 0]], 0.1)
    assert drops.is_closed
    assert drops.volume_m3 == pytest.approx(2 * 4 / 3 * 0.1**3)
    assert not Mesh(box.vertices_m, box.faces[1:]).is_closed


REFUSED = [
    ({"lamps": {"sky": SKY, "sun": SKY}}, "at most one lamp of kind sky"),
    ({"lamps": {"sun": {"kind": "area", "luminance_cd_per_m2": 1}}}, "an object that is this lamp"),
    ({"lamps": {"sun": {**SUN, "position_m": [0, 0, 1]}}}, "kind point"),
    ({"objects": {"a": {"material": "paint", "rectangle": FLAT, "wave": WAVE}}}, "'parts'"),
    ({"objects": {"a": {"material": "paint", "rectangle": MANY, "wave": WAVE}}}, "step_s"),
    ({"objects": {"a": {"material": "paint", "disk": DISK}}}, "direction"),
    ({"name": "../../x"}, "name"),
    ({"paths": {"seed": -1}}, "seed"),
]


@pytest.mark.parametrize(("changed", "says"), REFUSED, ids=[says for _, says in REFUSED])
def test_a_scene_that_cannot_be_is_one_line(
    tmp_path: Path, changed: dict[str, Any], says: str
) -> None:
    content = scene(tmp_path).file.model_dump(mode="json", exclude_unset=True)
    (tmp_path / "scene.yaml").write_text(json.dumps({**content, **changed}))
    with pytest.raises(UsageError, match=says) as raised:
        load_scene(tmp_path / "scene.yaml")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "content",
    [b"", b"PK\x03\x04 cut short", b"\x93NUMPY\x01\x00v\x00"],
    ids=["empty", "cut", "npy"],
)
def test_a_damaged_trajectory_is_one_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "drops.npz").write_bytes(content)
    drops = {"material": "paint", "particles": {"file": "drops.npz", "radius_m": 0.1}}
    with pytest.raises(UsageError, match=r"arrays in a \.npz file") as raised:
        scene(tmp_path, objects={"drops": drops}, step_s=1.0)
    assert "\n" not in str(raised.value)


def test_a_thin_sheet_is_charged_from_both_of_its_sides(tmp_path: Path) -> None:
    sheet = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]}
    levels = {}
    for towards in ([0, 0, 1], [0, 0, -1]):
        lamp = {"kind": "distant", "illuminance_lux": LUX, "towards": towards}
        for two_sided in (True, False):
            thing = {"material": "paint", "rectangle": sheet, "samples": [2, 2]}
            renderer = Renderer(
                scene(
                    tmp_path,
                    lamps={"sun": lamp},
                    objects={"sheet": {**thing, "two_sided": two_sided}},
                )
            )
            renderer.frame(0.0)
            levels[towards[2], two_sided] = float(renderer.levels["paint"].mean())
    assert levels[1, True] == pytest.approx(levels[1, False], rel=1e-4)
    assert levels[-1, True] == pytest.approx(levels[1, True], rel=1e-4)
    assert levels[-1, False] == 0


def test_where_the_scene_stands_does_not_matter(tmp_path: Path) -> None:
    """A square of 10 cm below a point lamp, at the origin and more than a kilometre from it."""
    levels = []
    for x in (0.0, 1000.0):
        at = np.array([x, -x, x])
        flat = {"corner_m": at.tolist(), "edge_u_m": [0.1, 0, 0], "edge_v_m": [0, 0.1, 0]}
        lamp = [x + 0.05, -x + 0.05, x + 0.3]
        renderer = Renderer(
            scene(
                tmp_path,
                lamps={"sun": {"kind": "point", "intensity_cd": 10.0, "position_m": lamp}},
                objects={"square": {"material": "paint", "rectangle": flat, "samples": [2, 2]}},
            )
        )
        renderer.frame(0.0)
        levels.append(float(renderer.levels["paint"].mean()))
    assert levels[1] == pytest.approx(levels[0], rel=1e-3)
    assert levels[0] > 0.05


def test_glow_that_excites_another_colour_does_not_depend_on_the_frames(tmp_path: Path) -> None:
    """Light that falls by decades between two pictures is followed in steps of its own."""
    entry = {"assume_albedo": 0.7, "assume_scale": 0.2}
    room = {"centre_m": [0, 0, 0], "size_m": [2, 2, 2], "inward": True}
    levels = []
    for frames_s in ([0, 300], [0, *range(2, 301, 2)]):
        built = scene(
            tmp_path,
            materials={
                "walls": {"file": "blue-paint", **entry},
                "ball": {"file": "yellow-paint", **entry},
            },
            lamps={"lamp": {"kind": "point", "intensity_cd": 50.0, "position_m": [0, 0.5, 0.8]}},
            objects={
                "room": {"material": "walls", "box": room, "samples": [3, 2]},
                "ball": {"material": "ball", "sphere": {"centre_m": [0, 0, 0], "radius_m": 0.5},
                         "samples": [4, 2]},
            },
            programme=[{"at_s": -60, "lamps": {"lamp": 1}}, {"at_s": 0, "lamps": {"lamp": 0}}],
            frames_s=frames_s,
            paths={"per_pixel": 1, "per_place": 64},
        )  # fmt: skip
        renderer = Renderer(built)
        for t_s in frames_s:
            renderer.advance(float(t_s))  # the pictures between are not wanted
        levels.append([float(renderer.levels[name].mean()) for name in ("walls", "ball")])
    np.testing.assert_allclose(levels[0], levels[1], rtol=0.02)


def test_parts_that_are_done_are_told_and_only_rise(tmp_path: Path) -> None:
    told: list[tuple[str, float]] = []
    moving = {"rectangle": MANY, "wave": WAVE, "material": "paint", "samples": [4, 4]}
    for changed in ({}, {"objects": {"square": moving}, "step_s": 50.0}):
        told.clear()
        renderer = Renderer(scene(tmp_path, **changed), report=lambda *each: told.append(each))
        list(renderer.frames())
        parts: dict[str, list[float]] = {}
        for what, part in told:
            parts.setdefault(what, []).append(part)
        assert len(parts) >= 3
        for what, rising in parts.items():
            assert all(0 < part <= 1 for part in rising), what
            assert rising[-1] == 1
        assert any("tracing" in what for what in parts)
        charging = next(rising for what, rising in parts.items() if "charging" in what)
        assert len(charging) > 3
        assert charging == sorted(charging)


def test_a_mesh_of_two_parts_keeps_its_own_texture_coordinates(tmp_path: Path) -> None:
    """Readers of meshes like to pack textures anew, and a picture over them would be elsewhere."""
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 0.5 0\nvt 0 0.5\nvt 1 1\n"
        "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/4 2/2 4/3\n"
    )
    mesh = read_mesh(tmp_path / "a.obj")
    assert mesh.uv is not None
    corners = np.concatenate([mesh.vertices_m, mesh.uv], axis=1)[mesh.faces]
    first = [[0, 0, 0, 0, 0], [1, 0, 0, 0.5, 0], [0, 1, 0, 0, 0.5]]
    second = [[0, 0, 0, 1, 1], [1, 0, 0, 0.5, 0], [0, 0, 1, 0, 0.5]]
    assert sorted(corners.tolist()) == [first, second]


def test_rays_of_steps_that_leave_a_closed_room_are_counted(tmp_path: Path) -> None:
    """A room that glows inside is seen from without: pictures have no rays in it, steps have."""
    side_m = 1e-7
    box = {"centre_m": [0, 0, 0], "size_m": [side_m] * 3, "inward": True}
    whole = Mesh.box((0, 0, 0), [side_m] * 3, inward=True).vertices_m
    with_slits = whole.copy()
    with_slits[:4, 0] += 4e-10
    shares = []
    for name, vertices_m in (("whole", whole), ("with-slits", with_slits)):
        np.savez(tmp_path / f"{name}.npz", t_s=[0, 1], vertices_m=[vertices_m, vertices_m])
        moving = scene(
            tmp_path,
            materials={"paint": {**PAINT, "assume_scale": 0.5, "levels": 0.5}},
            objects={"room": {"material": "paint", "box": box, "samples": [6, 4],
                              "vertices_over_time": f"{name}.npz"}},
            camera={"position_m": [0, 0, 9 * side_m], "look_at_m": [0, 0, 0], "up": [0, 1, 0],
                    "width_px": 4, "height_px": 4},
            programme=[{"at_s": -2, "lamps": {}}], frames_s=[0], step_s=1.0,
        )  # fmt: skip
        (frame,) = Renderer(moving).frames()
        assert not frame.radiance.any()
        expected = ["rays-escaped"] if frame.escaped_share > 0 else []
        assert codes(frame.warnings) == expected
        shares.append(frame.escaped_share)
    assert shares[0] == 0
    assert 0.001 < shares[1] < 0.02
