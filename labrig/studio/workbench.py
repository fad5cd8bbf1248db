"""Answers to the page: designs, and the files that are made of them."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from labrig.design import (
    Design,
    DesignBands,
    Parameters,
    Wish,
    WishFile,
    judge,
    nearest_materials,
    smooth_spectrum,
    to_material,
    to_wish,
)
from labrig.errors import UsageError
from labrig.material import Material, material_text
from labrig.report import describe_energy, describe_nearest, draw_design
from labrig.studio.messages import SOURCE, Asked, answer, wish_content
from labrig.yaml_file import parse_yaml, validate, yaml_text

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


class Workbench:
    """What answers a page about patches under a light of their own."""

    def __init__(self) -> None:
        self._last: tuple[str, tuple[Design, Wish]] | None = None
        #: What of the last wishes would take more energy than there is.
        self._energy: str | None = None

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
        design, wish = self.design(content)
        return answer(design, wish) | {"energy": self._energy}

    def design(self, content: Mapping[str, Any]) -> tuple[Design, Wish]:
        """Return the design that a page asks for, and its wish.

        Raises
        ------
        UsageError
            The message or the wish is malformed.
        """
        asked = Asked.of(content)
        # Numbers, pictures and files are asked for one after another.
        key = asked.model_dump_json()
        if self._last is None or self._last[0] != key:
            self._last = key, self._designed(asked)
        return self._last[1]

    def material(self, content: Mapping[str, Any]) -> str:
        """Return the text of the material file of a design."""
        return material_text(self._material_of(*self.design(content)))

    def constraints(self, content: Mapping[str, Any]) -> str:
        """Return the text of a file of wishes, as `labrig design --constraints` reads it."""
        file = self._wish(Asked.of(content).file(), SOURCE).file
        return yaml_text(file.model_dump(mode="json", exclude_none=True, exclude_defaults=True))

    def picture(self, content: Mapping[str, Any]) -> bytes:
        """Return a figure of a design over time as a PNG."""
        design, wish = self.design(content)
        if not wish.keys.count:
            raise UsageError("expected at least one key to be drawn, got none")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "design.png"
            draw_design(design, wish.places, path)
            return path.read_bytes()

    def nearest(self, content: Mapping[str, Any]) -> list[str]:
        """Return the measured materials that come nearest to the wishes, one sentence each."""
        design, _ = self.design(content)
        return [describe_nearest(each) for each in nearest_materials(design) if each]

    def _wish(self, file: WishFile, source: str) -> Wish:
        """Return a file's wish in the form in which it is solved."""
        if file.scene is not None:
            raise UsageError(
                f"{source}: expected keys on patches, got some in the scene {file.scene.file}; "
                f"design there: labrig design {file.scene.file} --open FILE"
            )
        return to_wish(file, source)

    def _designed(self, asked: Asked) -> tuple[Design, Wish]:
        wish = self._wish(asked.file(), SOURCE)
        self._energy = None
        if asked.by_hand is not None:
            given = asked.by_hand.parameters()
        elif wish.keys.count:
            wished = wish.solve()
            # While a hand drags, a quick answer matters more than the energy.
            if wished.keeps_energy or asked.is_draft:
                return wished, wish
            kept = wish.solve("kept")
            self._energy = (describe_energy(wished, kept) or "").removeprefix("! ") or None
            return kept, wish
        else:
            given = _to_begin_with(wish.bands, wish.file)
        weights = wish.file.weights
        return judge(given, wish.programme, wish.keys, wish.bands, weights), wish

    def _material_of(self, design: Design, wish: Wish) -> Material:
        return to_material(design, wish.file.name)


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
