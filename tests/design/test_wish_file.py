"""Files that say how something should glow, their command, and the manual's example."""

import doctest
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from labrig.design import read_wish, to_material, written_differences
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import yaml_text
from labrig.material import read_material
from tests.conftest import Ended

Labrig = Callable[..., Ended]
PAGE = Path(__file__).parents[2] / "docs/how-to/design.md"
LIGHT = [{"at": "0 s", "light": "D65"}, {"at": "10 s", "light": "none"}]
KEYS = [{"at": "11 s", "colour": [0, 0.01, 0.002]}, {"at": "30 s", "colour": [0, 0.002, 0.0004]}]


def written(folder: Path, **content: Any) -> Path:
    path = folder / "wish.yaml"
    path.write_text(yaml_text({"light": LIGHT, "keys": KEYS} | content), encoding="utf-8")
    return path


def test_a_white_card_under_the_light_is_white(tmp_path: Path) -> None:
    """All three ways of saying a colour mean the same, and so do both ways of saying a light."""
    keys = [
        {"at": "1 s", "colour": "#ffffff", "brightness": 0.5},
        {"at": "2 s", "colour": [0.5, 0.5, 0.5]},
        {"at": "3 s", "xyz": [0.4752, 0.5, 0.5445]},
    ]
    wish = read_wish(written(tmp_path, keys=keys, albedo=0.5))
    np.testing.assert_allclose(np.pi * wish.keys.radiance, 0.5, atol=2e-3)
    np.testing.assert_allclose(wish.programme.irradiance[0, 0], [1, 1, 1], atol=2e-3)
    assert wish.solve().cost < 1e-4
    light = [{"at": "0 s", "irradiance": [1, 1, 1]}]
    same = read_wish(written(tmp_path, keys=keys, light=light))
    np.testing.assert_allclose(
        same.programme.irradiance[0, 0], wish.programme.irradiance[0, 0], atol=2e-3
    )


def test_spectral_bands_see_a_light_that_eyes_do_not(tmp_path: Path) -> None:
    light = [{"at": "0 s", "light": "365nm", "strength": 2}, {"at": "10 s", "light": "none"}]
    wish = read_wish(written(tmp_path, light=light, bands_nm=list(range(350, 701, 25))))
    irradiance = wish.programme.irradiance[0, 0]
    assert irradiance[0] > 0
    assert not irradiance[2:].any()
    assert wish.solve().delta_e2000.max() < 0.5
    with pytest.raises(UsageError, match="365nm"):
        read_wish(written(tmp_path, light=light))


def test_places_have_their_own_lights(tmp_path: Path) -> None:
    places = {
        "table": LIGHT,
        "wall": [{"at": "5 s", "light": "A", "strength": 0.1}, {"at": "6 s", "light": "none"}],
    }
    keys = [{**KEYS[0], "place": "wall"}, {**KEYS[1], "place": "table"}]
    wish = read_wish(written(tmp_path, light=None, places=places, keys=keys))
    assert wish.places == ("table", "wall")
    assert wish.programme.begin_s.tolist() == [0, 5, 6, 10]
    assert wish.programme.irradiance[:, :, 1].round(1).tolist() == [[1, 1, 1, 0], [0, 0.1, 0, 0]]
    assert wish.keys.place.tolist() == [1, 0]


def test_the_command_writes_a_material_that_glows_as_wished(labrig: Labrig, tmp_path: Path) -> None:
    path, out = written(tmp_path, albedo=0.3), tmp_path / "out.yaml"
    ended = labrig("design", "--constraints", path, "--out", out)
    assert ended.code == 0
    assert "k_r" in ended.out
    wish = read_wish(path)
    material = read_material(out)
    assert written_differences(wish.solve(), material).max() < 2
    assert material.model_dump() == to_material(wish.solve(), "design").model_dump()


@pytest.mark.drawn
def test_the_command_draws_a_picture(labrig: Labrig, tmp_path: Path) -> None:
    picture = tmp_path / "glow.svg"
    assert labrig("design", "--constraints", written(tmp_path), "--picture", picture).code == 0
    assert picture.read_text(encoding="utf-8").count("<path") > 5


def test_the_manuals_example_prints_what_the_manual_shows(
    labrig: Labrig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = PAGE.read_text(encoding="utf-8")
    example, shown = (
        re.findall(rf"^```{kind}\n(.*?)^```$", page, re.M | re.S)[0] for kind in ("yaml", "text")
    )
    monkeypatch.chdir(tmp_path)
    Path("glow.yaml").write_text(example, encoding="utf-8")
    ended = labrig("design", "--constraints", "glow.yaml", "--out", "sea-green.yaml", "--nearest")
    options = doctest.NORMALIZE_WHITESPACE
    assert doctest.OutputChecker().check_output(shown, ended.out, options), ended.out


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"keys": [{"at": "1 s"}]}, "colour"),
        ({"keys": [{"at": "1 s", "colour": "green"}]}, "#20c060"),
        ({"keys": [{"at": "1 s", "colour": [float("nan"), 0, 0]}]}, "finite"),
        ({"keys": [{"at": "1 s", "colour": [1, 0, 0], "place": "x"}]}, "'x'"),
        ({"keys": [KEYS[0], {"at": "11 s", "colour": [1, 0, 0]}]}, "keys 1 and 2"),
        ({"keys": [KEYS[0], {"at": "12 s", "spectrum": [1, 0, 0]}]}, "colours or all spectra"),
        ({"keys": [{"at": "12 s", "spectrum": [1, 0]}]}, "3 bands"),
        ({"keys": [{"at": 3, "colour": [1, 0, 0]}]}, "3 s"),
        ({"light": []}, "at least one light"),
        ({"light": None}, "'light', 'places' and 'scene'"),
        ({"light": [{"at": "0 s"}]}, "'light' or 'irradiance'"),
        ({"light": [*LIGHT, {"at": "10 s", "light": "A"}]}, "rising"),
        ({"light": [{"at": "0 s", "irradiance": [1]}]}, "3 bands"),
        ({"light": [{"at": "0 s", "light": "D66"}]}, "D65"),
        ({"places": {"a": LIGHT}}, "'light' and 'places'"),
        ({"pixels": {"a": [0.5, 0.5]}}, "'pixels' beside 'scene'"),
        ({"light": None, "scene": {"file": "cornell-box", "material": "x"}}, "'pixels'"),
        ({"albedo": [0.1, 0.2]}, "3 bands"),
        ({"albedo": 1.5}, "1"),
        ({"states": 3}, "2"),
        ({"order": 9}, "4"),
        ({"bands_nm": [400, 300]}, "rising"),
        ({"lihgt": []}, "light"),
    ],
)
def test_improper_wishes_are_refused_in_one_line(
    labrig: Labrig, tmp_path: Path, content: dict[str, Any], said: str
) -> None:
    ended = labrig("design", "--constraints", written(tmp_path, **content))
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1
    assert said in ended.err


def test_a_file_that_cannot_be_written_is_one_line(labrig: Labrig, tmp_path: Path) -> None:
    out = tmp_path / "no" / "folder.yaml"
    ended = labrig("design", "--constraints", written(tmp_path), "--out", out)
    assert (ended.code, len(ended.err.splitlines())) == (5, 1)


numbers = st.floats(0, 1e3, allow_subnormal=False)
colours = st.tuples(numbers, numbers, numbers)


@settings(max_examples=15, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0, 100), st.tuples(numbers, numbers, numbers)), min_size=1, max_size=5
    ),
    st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=3),
    st.one_of(st.none(), st.floats(0, 1)),
)
def test_any_wish_has_an_answer_or_one_line(
    wishes: list[tuple[float, tuple[float, ...]]],
    lights: list[tuple[float, ...]],
    albedo: float | None,
) -> None:
    from labrig.design import Keys, LightProgramme, solve, three_bands

    programme = LightProgramme.checked(np.arange(len(lights)) * 10.0, lights)
    try:
        keys = Keys.checked(0, [time for time, _ in wishes], [colour for _, colour in wishes])
    except UsageError as error:
        assert "\n" not in str(error)
        return
    design = solve(programme, keys, three_bands(), albedo=albedo)
    assert np.isfinite(design.cost)
    assert np.isfinite(design.got_rgb).all()
    assert (design.reradiation >= 0).all()
    assert ((design.albedo >= 0) & (design.albedo <= 1)).all()
    assert all("\n" not in str(wish) for wish in design.impossible)


def test_without_keys_there_is_nothing_to_solve(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="at least one key"):
        read_wish(written(tmp_path, keys=[])).solve()
