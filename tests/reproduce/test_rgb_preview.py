"""Re-radiation reduced to three colours, against all wavelengths."""

from pathlib import Path

import colour
import numpy as np
import pytest
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.material import ReradiationMatrix, read_any_material
from labrig.optics import CIE_1931, XYZ_TO_SRGB, illuminant, observer, read_light
from labrig.reproduce import (
    Bands,
    ExportedMesh,
    Lamp,
    SurfaceMaterial,
    of_albedo,
    of_matrix,
    rgb_preview,
    tristimulus,
    write_gltf,
)
from tests.reproduce.gltf_reader import Read

BANDS = Bands.even()
LIGHTS = ("D65", "A", "FL2", "450nm")
TEXTILES = ("yellow-textile", "orange-textile", "white-paper")


def lamps(names: tuple[str, ...] = LIGHTS) -> list[Lamp]:
    return [Lamp(name, "distant", BANDS.means(read_light(name))) for name in names]


def fluorescent(name: str) -> ReradiationMatrix:
    matrix = read_any_material(name)
    assert isinstance(matrix, ReradiationMatrix)
    return matrix


def test_an_even_grey_is_reduced_exactly() -> None:
    preview = rgb_preview(of_albedo("grey", 0.4, BANDS), BANDS, lamps())
    np.testing.assert_allclose(preview.matrix, 0.4 * np.eye(3), atol=1e-6)
    assert list(preview.delta_e.values()) == pytest.approx([0] * len(LIGHTS), abs=0.01)
    # In bands, D65 is not quite the white of a screen.
    assert list(preview.delta_e_of_colour.values()) == pytest.approx([0] * len(LIGHTS), abs=0.35)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_surface_that_does_nothing_else_than_a_matrix_of_three_colours_is_reduced_to_it(
    seed: int,
) -> None:
    true = np.random.default_rng(seed).uniform(0.0, 0.4, (3, 3)) + 0.2 * np.eye(3)
    project = XYZ_TO_SRGB @ tristimulus(np.eye(len(BANDS)), BANDS.edges_nm).T
    spectral = np.linalg.pinv(project) @ true @ project
    surface = SurfaceMaterial("made", spectral.astype(np.float32))
    preview = rgb_preview(surface, BANDS, lamps())
    np.testing.assert_allclose(preview.matrix, true, atol=1e-4)
    assert max(value for value in preview.delta_e.values() if value is not None) < 0.01


def seen_xyz(matrix: ReradiationMatrix, light: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """X, Y, Z of light, and of what comes back, at each nm: no bands (3,)."""
    eye = observer(CIE_1931)
    spectrum = illuminant(light)
    back = matrix.under(spectrum).total.at(eye.wavelength_nm)
    falls = spectrum.at(eye.wavelength_nm) @ eye.functions
    return falls / falls[1], back @ eye.functions / falls[1], eye.wavelength_nm


@pytest.mark.parametrize("name", TEXTILES)
@pytest.mark.parametrize("light", ["D65", "A", "FL2"])
def test_the_stated_difference_is_that_of_a_spectral_evaluation(name: str, light: str) -> None:
    matrix = fluorescent(name)
    preview = rgb_preview(of_matrix(matrix, BANDS), BANDS, lamps())
    falls, back, _ = seen_xyz(matrix, light)
    reduced = _xyz(preview.matrix @ _rgb(falls))
    white = colour.XYZ_to_xy(falls)
    by_wavelength = colour.delta_E(
        colour.XYZ_to_Lab(back, white), colour.XYZ_to_Lab(reduced, white), method="CIE 2000"
    )
    # Bands of 20 nm displace both.
    assert preview.delta_e[light] == pytest.approx(float(by_wavelength), abs=0.7)
    of_colour = preview.delta_e_of_colour["A"]
    assert of_colour is not None
    assert of_colour > 2 * (preview.delta_e["A"] or np.inf)


def _rgb(xyz: ArrayLike) -> FloatArray:
    return np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB @ np.asarray(xyz))


def _xyz(rgb: ArrayLike) -> FloatArray:
    return np.asarray(colour.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ @ np.asarray(rgb))


def test_what_ultraviolet_excites_is_missing_and_said() -> None:
    paper = of_matrix(fluorescent("white-paper"), BANDS)
    preview = rgb_preview(paper, BANDS, lamps(("D65", "365nm")))
    assert (preview.delta_e["365nm"] or 0) > 30 > 5 > (preview.delta_e["D65"] or np.inf)
    dark = rgb_preview(paper, BANDS, [Lamp("infrared", "distant", np.zeros(len(BANDS)))])
    assert dark.delta_e == {"infrared": None}


def test_a_gltf_file_carries_it_as_a_preview_with_its_difference(tmp_path: Path) -> None:
    preview = rgb_preview(of_matrix(fluorescent("orange-textile"), BANDS), BANDS, lamps())
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    textile, grey = (
        ExportedMesh("sheet", corners, np.array([[0, 1, 2]]), np.full(3, 0.5), preview=each)
        for each in (preview, None)
    )
    write_gltf(tmp_path / "sheet.glb", [textile, grey], [0.0])
    of_textile, of_grey = Read(tmp_path / "sheet.glb").json["materials"]
    assert "extras" not in of_grey
    said = of_textile["extras"]["reradiationPreview"]
    np.testing.assert_allclose(said["linearSrgbFromLinearSrgb"], preview.matrix, atol=1e-6)
    assert said["deltaE2000UnderLamps"] == pytest.approx(dict(preview.delta_e), abs=0.01)
    assert said["preview"].startswith("preview")


def test_the_manual_says_what_shipped_materials_lose() -> None:
    page = Path(__file__).parents[2] / "docs" / "how-to" / "render.md"
    text = page.read_text(encoding="utf-8")
    under = lamps(("D65", "A", "FL11", "450nm", "365nm"))
    for name in TEXTILES:
        preview = rgb_preview(of_matrix(fluorescent(name), BANDS), BANDS, under)
        of_colour = [preview.delta_e_of_colour[light] for light in ("A", "FL11")]
        cells = [f"{value:.2g}" for value in (*preview.delta_e.values(), *of_colour)]
        assert f"| `{name}` | {' | '.join(cells)} |" in text
