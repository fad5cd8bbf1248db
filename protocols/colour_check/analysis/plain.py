"""A plain photograph of the chart: its colours by the camera's curves, and what errors make of it.

The grey card in the chart's place tells brightness and evenness of the light, and balances the
channels, so that only the course of the curves counts. Their ratios are tested by themselves.
"""

from dataclasses import dataclass

import numpy as np

from labrig.analyse.chart_scene import ChartScene
from labrig.foundation.arrays import FloatArray
from labrig.optics import CameraResponse, Transmittance
from labrig.protocols.colour_check.analysis.colours import (
    DRAWS,
    GRID_NM,
    PublishedChart,
    drawn_curves,
)

#: Relative σ of the grey card's reflectance: its level in all channels, and of each.
CARD_LEVEL, CARD_EACH = 0.01, 0.005


@dataclass(frozen=True, eq=False)
class PlainColours:
    """Colours in a plain photograph.

    Attributes
    ----------
    xyz
        X, Y, Z of the patches, shape (p, 3).
    drawn
        X, Y, Z as errors alone would make them, shape (draws, p, 3).
    balance, balance_sigma
        Values of the card over those by curves and lamp, relative to their mean, and σ, shape (k,).
    """

    xyz: FloatArray
    drawn: FloatArray
    balance: FloatArray
    balance_sigma: FloatArray


def plain_colours(
    scene: ChartScene,
    chart: PublishedChart,
    camera: CameraResponse,
    card: Transmittance,
    matrix: FloatArray,
) -> PlainColours:
    """Return the colours in the photograph, and what errors make of the published ones.

    Parameters
    ----------
    scene
        Values of chart and card.
    chart
        Published colours under the lamp.
    camera
        Curves of the camera.
    card
        Reflectance of the grey card.
    matrix
        From the camera's values of the light in `chart` to X, Y, Z, shape (3, k).
    """
    assert scene.card is not None, "a check of colours has a card"
    reflectance = card.at(GRID_NM) * chart.light
    expected = reflectance @ camera.at(GRID_NM)
    balance = scene.card / expected
    xyz = (scene.value / balance) @ matrix.T
    rng = np.random.default_rng(0)
    curves = drawn_curves(camera, rng, DRAWS)
    patches = (chart.own_reflectances(rng, DRAWS) * chart.light) @ curves
    patches *= 1 + scene.sigma / scene.value * rng.standard_normal(patches.shape)
    uneven = scene.unevenness * rng.standard_normal((DRAWS, 2)) @ scene.place.T
    patches *= 1 + uneven[:, :, np.newaxis]
    seen = reflectance @ curves
    seen *= 1 + CARD_LEVEL * rng.standard_normal((DRAWS, 1))
    seen *= 1 + CARD_EACH * rng.standard_normal(seen.shape)
    factors = seen / expected
    balances = factors / factors.mean(axis=1, keepdims=True)
    drawn = (patches / factors[:, np.newaxis, :]) @ matrix.T
    return PlainColours(xyz, drawn, balance / balance.mean(), balances.std(axis=0))
