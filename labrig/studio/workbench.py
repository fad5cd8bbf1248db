"""Answers to the page: designs, and the files that are made of them."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from labrig.design import (
    Design,
    DesignBands,
    Parameters,
    SceneSpectra,
    Wish,
    WishFile,
    judge,
    nearest_materials,
    preset_parameters,
    presets,
    smooth_spectrum,
    to_material,
    to_wish,
    written_factor,
)
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_PICTURE_BYTES, read_bytes
from labrig.foundation.yaml_file import parse_yaml, validate, yaml_text
from labrig.material import Material, material_text
from labrig.report import describe_energy, describe_factor, describe_nearest, draw_design
from labrig.studio.messages import (
    MAX_STATES,
    SOURCE,
    Asked,
    answer,
    parameters_content,
    wish_content,
)

#: Name of a file that was opened, in messages.
OPENED = "the opened file"
#: What a page begins with: five minutes of daylight, then darkness.
START: Mapping[str, Any] = {
    "name": "design",
    # Keys in the dark say nothing about it.
    "albedo": 0.6,
    "places": {
        "patch": [{"at": "0 s", "light": "D65"}, {"at": "300 s", "light": "none"}],
    },
}
#: A glow to look at before anything is wished for: its colour, Λ, k_r, k_e and albedo.
GREEN, BRIGHTNESS, K_R_PER_S, K_E_PER_S, ALBEDO = (0.1, 1.0, 0.3), 0.1, 0.02, 1e-3, 0.6


class Designed(NamedTuple):
    """A design that a page asked for.

    Attributes
    ----------
    design, wish
        The material, and what was wished for.
    energy
        What of it would take more energy than there is, in a sentence.
    """

    design: Design
    wish: Wish
    energy: str | None


class Workbench:
    """What answers a page about patches under a light of their own."""

    def __init__(self) -> None:
        self._last: tuple[str, Designed] | None = None

    def start(self) -> dict[str, Any]:
        """Return the wish with which a page begins."""
        return wish_content(validate(START, WishFile, SOURCE))

    def take(self, file: WishFile, source: str) -> dict[str, Any]:
        """Return the wish of a file.

        Raises
        ------
        UsageError
            It is malformed.
        """
        return wish_content(self._wish(file, source).file)

    def open(self, text: str) -> dict[str, Any]:
        """Return the wish of a file's text.

        Raises
        ------
        UsageError
            It is malformed.
        """
        file = validate(parse_yaml(text, OPENED), WishFile, OPENED)
        return self.take(file, OPENED)

    def look(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the material that meets the page's wishes, or that was set by hand."""
        found = self.design(content)
        return answer(found.design, found.wish) | {"energy": found.energy}

    def design(self, content: Mapping[str, Any]) -> "Designed":
        """Return the design that a page asks for.

        Raises
        ------
        UsageError
            The message or the wish is malformed.
        """
        asked = Asked.of(content)
        # Numbers, pictures and files are asked for one after another.
        key, last = asked.model_dump_json(), self._last
        if last is None or last[0] != key:
            last = self._last = key, self._designed(asked)
        return last[1]

    def material(self, content: Mapping[str, Any]) -> str:
        """Return the text of the material file of a design."""
        found = self.design(content)
        return material_text(self._material_of(found.design, found.wish))

    def constraints(self, content: Mapping[str, Any]) -> str:
        """Return the text of a file of wishes, as `labrig design --constraints` reads it."""
        file = self._wish(Asked.of(content).file(), SOURCE).file
        return yaml_text(file.model_dump(mode="json", exclude_none=True, exclude_defaults=True))

    def picture(self, content: Mapping[str, Any]) -> bytes:
        """Return a figure of a design over time as a PNG."""
        found = self.design(content)
        if not found.wish.keys.count:
            raise UsageError("expected at least one key to be drawn, got none")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "design.png"
            draw_design(found.design, found.wish.places, path)
            return read_bytes(path, MAX_PICTURE_BYTES)

    def nearest(self, content: Mapping[str, Any]) -> list[str]:
        """Return the measured materials that come nearest to the wishes, one sentence each."""
        design = self.design(content).design
        return [describe_nearest(each) for each in nearest_materials(design) if each]

    def preset_names(self) -> list[str]:
        """Return the names of the measured materials with which a design may begin."""
        return [each.name for each in presets() if len(each.states) <= MAX_STATES]

    def preset(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters of a measured material, as if they were set by hand.

        Raises
        ------
        UsageError
            There is no such material, or the design has other bands than three channels.
        """
        name = content.get("name")
        wish = self._wish(Asked.of({"wish": content.get("wish")}).file(), SOURCE)
        found = [each for each in presets() if each.name == name]
        if not found:
            raise UsageError(f"expected a measured material, got {name!r:.60}")
        albedo = ALBEDO if isinstance(wish.file.albedo, str) else wish.file.albedo
        return parameters_content(preset_parameters(found[0], wish.programme, wish.bands, albedo))

    def _wish(self, file: WishFile, source: str) -> Wish:
        """Return a file's wish in the form in which it is solved."""
        if file.scene is not None:
            raise UsageError(
                f"{source}: expected keys on patches, got some in the scene {file.scene.file}; "
                f"design there: labrig design {file.scene.file} --open FILE"
            )
        return to_wish(file, source)

    def _designed(self, asked: Asked) -> "Designed":
        wish = self._wish(asked.file(), SOURCE)
        if asked.by_hand is not None or not wish.keys.count:
            given = (
                _to_begin_with(wish.bands, wish.file)
                if asked.by_hand is None
                else asked.by_hand.parameters()
            )
            design = judge(given, wish.programme, wish.keys, wish.bands, wish.file.weights)
            return Designed(design, wish, self._weaker(design, wish, asked))
        # While a hand drags, a quick answer matters more than the energy.
        if asked.is_draft:
            return Designed(wish.solve(), wish, None)
        wished, kept = wish.solve_kept()
        cost = (describe_energy(wished, kept) or "").removeprefix("! ")
        return Designed(kept, wish, cost or self._weaker(kept, wish, asked))

    def _weaker(self, design: Design, wish: Wish, asked: Asked) -> str | None:
        """Say that the material that is saved glows less, if it does."""
        if asked.is_draft or not wish.programme.irradiance.any():
            return None
        factor = written_factor(design, self._light_of(wish))
        return describe_factor(factor)

    def _light_of(self, wish: Wish) -> SceneSpectra | None:
        """Return the spectral light of a scene on the places of a wish; None of patches."""
        return None

    def _material_of(self, design: Design, wish: Wish) -> Material:
        return to_material(design, wish.file.name, self._light_of(wish))


def _to_begin_with(bands: DesignBands, file: WishFile) -> Parameters:
    """Return a plain green glow in as many states as are wished for."""
    emitted = np.array(GREEN)
    if bands.edges_nm is not None:
        emitted = smooth_spectrum(emitted, bands.to_rgb)
    states = file.states
    order = 1.0 if isinstance(file.order, str) else file.order
    albedo = ALBEDO if isinstance(file.albedo, str) else file.albedo
    return Parameters.checked(
        K_R_PER_S / 10.0 ** np.arange(states),
        np.full((states, bands.count), K_E_PER_S / bands.count),
        np.tile(BRIGHTNESS * emitted / states, (states, 1)),
        np.broadcast_to(np.asarray(albedo, dtype=np.float64), (bands.count,)),
        order,
    )
