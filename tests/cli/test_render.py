"""`labrig render`."""

import io
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from labrig.cli import under_way
from labrig.foundation import colour_science
from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import as_warnings
from labrig.optics import (
    CHART_PATCHES,
    CIE_1931,
    XYZ_TO_SRGB,
    delta_e,
    lab,
    observer,
    white_xyz,
)
from labrig.reproduce import (
    Mesh,
    RenderFolder,
    exported_meshes,
    load_scene,
    read_linear_exr,
    read_spectral_exr,
    tristimulus,
)
from tests.conftest import Ended

SMALL = ("--size", "12x9", "--paths", "4")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def comment(picture: Path) -> str:
    """Comment of a PNG file."""
    with Image.open(picture) as image:
        return str(image.info["Comment"])


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are those of Linux")
def test_lack_of_memory_is_one_line() -> None:
    """Libraries that are written in C++ crash, where they get none."""
    text = (
        "import resource\n"
        "from labrig.cli import guarded\n"
        "resource.setrlimit(resource.RLIMIT_AS, (500_000_000, 500_000_000))\n"
        "raise SystemExit(guarded(['render', 'cornell-box']))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stdout) == (5, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith("labrig: this PC has too little memory left (700 MB are needed to begin")


def test_pictures_of_all_times_with_what_was_assumed(labrig: Callable[..., Ended]) -> None:
    ended = labrig("render", "cornell-box", *SMALL, "--times", "-1,0,5", "--material",
                   "phosphorescent=pink-paint", "--linear")  # fmt: skip
    assert ended.code == 0, ended.err
    folder = ended.run_folder
    spectral = read_spectral_exr(folder / "000.exr")
    luminance = tristimulus(spectral.radiance, spectral.edges_nm)[..., 1]
    linear = read_linear_exr(folder / "000-linear.exr")[..., 1]
    np.testing.assert_allclose(linear, luminance, rtol=1e-3, atol=1e-3 * luminance.max())
    assert {"000.png", "001.png", "002.png"} <= {path.name for path in folder.iterdir()}
    content = json.loads((folder / "render.json").read_text(encoding="utf-8"))
    notes = as_warnings(content["notes"])
    assert any("pink-paint" in note.subject for note in notes)
    # An assumption is in every picture, too, not only below the sheet.
    assert all(str(note) in comment(folder / "001.png") for note in notes)
    dark = read_spectral_exr(folder / "001.exr").radiance
    later = read_spectral_exr(folder / "002.exr").radiance
    # One exponential of 0.027 per second, which the glow itself slows by a part in a thousand.
    lit = dark > 0
    assert lit.any()
    np.testing.assert_allclose(later[lit] / dark[lit], np.exp(-0.027 * 5), rtol=3e-3)


def test_a_rendering_that_was_killed_goes_on_to_the_same_pictures(
    labrig: Callable[..., Ended],
) -> None:
    assert labrig("render", "cornell-box", *SMALL, "--out", "whole").code == 0
    scene = load_scene("cornell-box").resized(12, 9, 4)
    part = RenderFolder.open(Path("part"), scene).rendered(scene)
    next(part)
    next(part)
    part.close()  # type: ignore[attr-defined]
    # The last frame of a killed one may be half written.
    (Path("part") / ".002.exr.draft").write_bytes(b"half")
    ended = labrig("render", "cornell-box", *SMALL, "--out", "part")
    assert ended.code == 0, ended.err
    for number in range(3):
        whole, resumed = (
            read_spectral_exr(Path(name) / f"{number:03d}.exr").radiance
            for name in ("whole", "part")
        )
        np.testing.assert_array_equal(whole, resumed)


def png_lab(path: Path) -> FloatArray:
    """CIELAB of a picture's bytes, shape (height, width, 3)."""
    colour, white = colour_science.load(), white_xyz("D65", observer(CIE_1931))
    picture = cv2.imread(str(path))
    assert picture is not None
    rgb = picture[..., ::-1] / 255
    linear = colour.cctf_decoding(rgb, function="sRGB")
    return lab(linear @ np.linalg.inv(XYZ_TO_SRGB).T, white)


def test_a_chart_has_its_published_srgb(labrig: Callable[..., Ended]) -> None:
    """The colours of the mean of 30 charts under D50, adapted to the screen by Bradford."""
    ended = labrig("render", "colour-chart", "--size", "62x42", "--paths", "4")
    assert ended.code == 0, ended.err
    seen = png_lab(ended.run_folder / "000.png")[5::10, 5::10].reshape(24, 3)
    colour, white = colour_science.load(), white_xyz("D65", observer(CIE_1931))
    published = colour.CCS_COLOURCHECKERS["BabelColor Average"]
    adapted = colour.chromatic_adaptation(
        colour.xyY_to_XYZ(np.array(list(published.data.values()))),
        colour.xy_to_XYZ(published.illuminant), white, method="Von Kries", transform="Bradford",
    )  # fmt: skip
    difference = delta_e(seen, lab(np.asarray(adapted), white))
    # Cyan is beyond the screen's gamut.
    in_gamut = difference[[name != "cyan" for name in CHART_PATCHES]]
    assert in_gamut.max() < 0.7
    assert in_gamut.mean() < 0.4
    statement = comment(ended.run_folder / "000.png")
    assert "Bradford" in statement
    assert "0.3457, 0.3585" in statement  # of D50, CIE 15
    # Another look needs no new rendering.
    before = (ended.run_folder / "000.exr").stat().st_mtime_ns
    again = labrig("render", "colour-chart", "--size", "62x42", "--paths", "4", "--white", "D65",
                   "--exposure", "400")  # fmt: skip
    assert again.code == 0, again.err
    assert (ended.run_folder / "000.exr").stat().st_mtime_ns == before
    yellower = png_lab(ended.run_folder / "000.png")[35, 5]
    assert yellower[2] > seen[18, 2] + 15
    assert "D65 of luminance 400" in comment(ended.run_folder / "000.png")


def test_other_settings_do_not_mix_with_what_is_there(labrig: Callable[..., Ended]) -> None:
    assert labrig("render", "cornell-box", *SMALL, "--times", "0").code == 0
    ended = labrig("render", "cornell-box", *SMALL, "--times", "1")
    assert ended.code == 2
    assert "--out" in ended.err
    Path("mine").mkdir()
    (Path("mine") / "thesis.txt").write_text("words")
    assert labrig("render", "cornell-box", *SMALL, "--out", "mine").code == 2
    assert (Path("mine") / "thesis.txt").read_text() == "words"
    shutil.rmtree("mine")


class TerminalText(io.StringIO):
    """Text that a command writes to a terminal."""

    def isatty(self) -> bool:
        return True


def test_on_a_terminal_it_says_what_is_done_and_for_how_long(
    labrig: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    text = TerminalText()
    with monkeypatch.context() as on_terminal:
        on_terminal.setattr(sys, "stderr", text)
        for patience in ("PATIENCE_S", "FORESEEN_S"):
            on_terminal.setattr(under_way, patience, 0.0)
        on_terminal.setattr(under_way, "PERIOD_S", 0.01)
        assert labrig("render", "cornell-box", *SMALL).code == 0
    shown = text.getvalue()
    # A phase that is over between two looks at it leaves no line.
    phases = "tracing paths of phosphors|tracing paths of the picture|charging and decay"
    assert re.search(rf"({phases}).*, \d+ of 100, .* left", shown)
    assert "picture 3 of 3" in shown
    ended = labrig("render", "cornell-box", *SMALL, "--out", "piped")
    assert "tracing" not in ended.err
    assert "\x1b" not in ended.err
    assert [line for line in ended.err.splitlines() if line.startswith("picture")] != []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["cornel-box"], "cornell-box"),
        (["cornell-box", "--material", "phosphorescent"], "NAME=FILE"),
        (["cornell-box", "--material", "wall=blue-paint"], "phosphorescent"),
        (["cornell-box", "--size", "0x4"], "640x480"),
        (["cornell-box", "--times", "1,0"], "rise"),
        (["cornell-box", "--times", "soon"], "0,1,80"),
        (["cornell-box", "--times", "-900"], "programme"),
        (["cornell-box", "--exposure", "bright"], "common"),
        (["cornell-box", "--size", "8192x8192", "--paths", "65536"], "memory"),
        (["cornell-box", "--exposure", "-1"], "greater than 0"),
        (["cornell-box", "--white", "450nm"], "450nm"),
        (["cornell-box", "--white", "nonsense"], "D50"),
        (["cornell-box", "--white", "none.csv"], "none.csv"),
    ],
)
def test_what_cannot_be_rendered_is_one_line(
    labrig: Callable[..., Ended], arguments: list[str], says: str
) -> None:
    ended = labrig("render", *arguments)
    assert ended.code == 2
    (line,) = ended.err.splitlines()
    assert says in line
    assert not Path("renders").exists()


def test_other_programs_take_the_scene(labrig: Callable[..., Ended]) -> None:
    ended = labrig("render", "cornell-box", *SMALL, "--gltf", "box.glb", "--mitsuba", "for-mitsuba")
    assert ended.code == 0, ended.err
    assert Path("box.glb").read_bytes()[:4] == b"glTF"
    text = (Path("for-mitsuba") / "scene.xml").read_text(encoding="utf-8")
    # The wall of orange textile is the only surface that re-radiates.
    comments = re.findall(r"<!-- (.*?): preview of re-radiation", text)
    beside = (Path("for-mitsuba") / "reradiation_previews.json").read_text(encoding="utf-8")
    assert comments == list(json.loads(beside)) == ["right"]
    assert "ΔE2000" in ended.err
    scene = load_scene("cornell-box").resized(12, 9, 4)
    meshes = exported_meshes(scene, RenderFolder.open(ended.run_folder, scene))
    wall, lamp = (next(each for each in meshes if each.name == name) for name in ("left", "lamp"))
    assert wall.glow is not None
    assert lamp.glow is not None
    # The lamp goes off, and the glow of one exponential keeps its texture.
    np.testing.assert_allclose(lamp.glow.colour[:, 1] > 0, [True, False, False])
    ratio = wall.glow.colour[2, 2] / wall.glow.colour[1, 2]
    # Its own light, back from the walls, charges it a little again.
    assert ratio == pytest.approx(np.exp(-0.032 * 59.9), rel=0.04)
    assert wall.glow.lost < 0.02


def test_a_room_that_is_not_tight_is_told(labrig: Callable[..., Ended]) -> None:
    """Sides of a box that nearly meet count as closed; the rays between them are counted."""
    box = Mesh.box((0, 0, 0), (1, 1, 1))
    ends = {}
    for name, slit in (("tight", 0.0), ("leaky", 4e-3)):
        moved = box.vertices_m.copy()
        moved[:4, 0] += slit
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in moved.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (box.faces + 1).tolist()]
        Path(f"{name}.obj").write_text("\n".join(lines), encoding="utf-8")
        room = {"file": f"{name}.obj", "size_m": 1e-7, "inward": True}
        Path(f"{name}.yaml").write_text(json.dumps({
            "name": name, "kind": "scene", "materials": {"wall": {"albedo": 0.5}},
            "lamps": {"lamp": {"kind": "point", "intensity_cd": 1, "position_m": [0, 0, 2e-8]}},
            "objects": {"room": {"material": "wall", "mesh": room}},
            "camera": {"position_m": [0, 0, 0], "look_at_m": [1e-8, 1e-9, 0]},
            "programme": [{"at_s": 0, "lamps": {"lamp": 1}}], "frames_s": [0],
        }), encoding="utf-8")  # fmt: skip
        ends[name] = labrig("render", f"{name}.yaml", "--size", "32x24", "--paths", "16")
        assert ends[name].code == 0, ends[name].err
    assert "warning" not in ends["tight"].err
    assert "left the closed room" in ends["leaky"].err


def test_what_failed_before_its_first_picture_does_not_stand_in_the_way(
    labrig: Callable[..., Ended],
) -> None:
    """A scene is corrected, and rendered into the same folder."""
    flat = {"corner_m": [0, 0, 0], "edge_u_m": [1, 0, 0], "edge_v_m": [0, 1, 0]}
    for per_place, code in ((65536, 2), (4, 0)):
        Path("s.yaml").write_text(json.dumps({
            "name": "s", "kind": "scene",
            "materials": {
                "paint": {"file": "blue-paint", "assume_albedo": 0.6, "assume_scale": 0.5}
            },
            "objects": {"a": {"material": "paint", "rectangle": flat, "samples": [2, 2]}},
            "camera": {"position_m": [0, 0, 1], "look_at_m": [0, 1, 0]},
            "programme": [{"at_s": 0, "lamps": {}}], "frames_s": [0],
            "paths": {"per_place": per_place, "per_pixel": per_place},
        }), encoding="utf-8")  # fmt: skip
        size = ["--size", "8192x8192"] if code else ["--size", "8x8"]
        ended = labrig("render", "s.yaml", *size)
        assert ended.code == code, ended.err
        assert len([line for line in ended.err.splitlines() if "labrig:" in line]) == bool(code)


@pytest.mark.parametrize("missing", ["embreex", "manifold3d", "numba"])
def test_without_the_extra_it_is_one_line(
    labrig: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    for name in list(sys.modules):
        if name.split(".")[0] == missing or name.endswith("kernels"):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    around = [(0, 0), (5, 0), (5, 4), (4, 4), (4, 1), (1, 1), (1, 4), (0, 4)]
    Path("a.obj").write_text(
        "".join(f"v {x} {y} 0\n" for x, y in around) + "f 1 2 3 4 5 6 7 8\n", encoding="utf-8"
    )
    Path("s.yaml").write_text(json.dumps({
        "name": "s", "kind": "scene", "materials": {"grey": {"albedo": 0.5}},
        "objects": {"a": {"material": "grey", "mesh": {"file": "a.obj"}, "two_sided": True}},
        "camera": {"position_m": [0, 0, 1], "look_at_m": [0, 1, 0]},
        "programme": [{"at_s": 0, "lamps": {}}], "frames_s": [0],
    }), encoding="utf-8")  # fmt: skip
    ended = labrig("render", "s.yaml", *SMALL)
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1
    assert "pip install 'labrig[render]'" in ended.err
