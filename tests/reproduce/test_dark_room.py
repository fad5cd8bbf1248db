"""The dark room as a scene: where samples and card are seen, and how much light they return."""

from pathlib import Path

import numpy as np
import pytest

from labrig.foundation import resources
from labrig.optics import absolute_irradiance, read_spectrum, read_transmittance
from labrig.reproduce import (
    DarkRoomLamp,
    DarkRoomPicture,
    MaterialEntry,
    Renderer,
    build_scene,
    dark_room,
)

LAMP = DarkRoomLamp(str(resources.curve_path("halogen_3000k")), 700.0)
CARD = str(resources.curve_path("grey_card_18"))


@pytest.mark.parametrize("card", [None, CARD])
def test_every_region_of_the_frame_is_seen_where_it_was_photographed(card: str | None) -> None:
    patches = {
        "left": ((0.1, 0.25, 0.3, 0.5), MaterialEntry(albedo=0.2)),
        "right": ((0.5, 0.0, 0.5, 0.25), MaterialEntry(albedo=0.8)),
    }
    picture = DarkRoomPicture(60, 40)
    scene = build_scene(
        dark_room("bench", patches, LAMP, [(0.0, 1.0)], [0.0], picture, card), Path()
    )
    seen = Renderer(scene, threads=1).frame(0.0).radiance
    whole = scene.bands.means(absolute_irradiance(700.0, read_spectrum(LAMP.spectrum)))
    expected = np.zeros((40, 60))
    expected[10:30, 6:24] = 0.2
    expected[:10, 30:] = 0.8
    lit = whole > 0
    albedo = np.pi * seen[:40, :, lit] / whole[lit]
    np.testing.assert_allclose(albedo, np.repeat(expected[..., None], lit.sum(), 2), rtol=1e-5)
    assert len(seen) == (40 if card is None else 48)
    if card is not None:
        below = np.pi * seen[-1][:, lit] / whole[lit]
        reflectance = read_transmittance(CARD).at(scene.bands.centre_nm[lit])
        inside = reflectance > 0
        np.testing.assert_allclose(
            below[:, inside], np.tile(reflectance[inside], (60, 1)), rtol=0.01
        )
