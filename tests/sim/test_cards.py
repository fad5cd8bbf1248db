"""Grey card, blank and ColorChecker, with a door and without one."""

import numpy as np
import pytest

from labrig.foundation import colour_science
from labrig.sim.cards import COLUMNS, ROWS, reflectances, surfaces
from labrig.sim.lamp import BURNING_K, WAVELENGTH_NM, filament_spectrum
from labrig.sim.optics import bent_curves
from tests.sim.darkroom import DOOR, Darkroom, colours

LIT = {"initial": {"lamp": "on"}}


def lit(*tasks: str, **changed: object) -> Darkroom:
    bench = Darkroom(**{**LIT, **changed})
    bench.clock.spend(1.0)
    bench.do(*tasks)
    return bench


def test_a_grey_card_is_nearly_grey_and_fills_the_frame() -> None:
    (_, grey, trap) = reflectances("grey card", 0.18)
    assert not trap.any()
    assert grey == pytest.approx(0.18, rel=0.03)
    assert grey.std() > 0
    frame = lit("grey card").shoot(1 / 60, 100, 5.6)
    assert frame.min() > 400
    dark, light = (lit("grey card", grey_card=part).shoot(1 / 60, 100, 8) for part in (0.18, 0.36))
    assert light.mean() == pytest.approx(2 * dark.mean(), rel=0.02)


def test_with_a_door_the_card_lies_on_its_outside() -> None:
    bench = lit("grey card", door={})
    closed = bench.shoot(1 / 60, 100, 5.6)
    assert closed == pytest.approx(lit("grey card").shoot(1 / 60, 100, 5.6), rel=0.1, abs=60)
    bench.room.switch_lamp(False)
    bench.clock.spend(3.0)
    assert bench.shoot()[20:44].mean() == pytest.approx(0, abs=1)
    bench.swing(DOOR.open)
    assert bench.shoot()[20:44].mean() > 100, "the sample below was charged, and is seen now"


def test_without_a_door_the_card_lies_on_the_sample() -> None:
    bench = Darkroom(initial={"concentration": 0.5})
    bench.do("grey card")
    assert bench.shoot()[20:44].mean() == pytest.approx(0, abs=1)
    fresh = Darkroom()
    fresh.do("grey card")
    fresh.charge(600.0)
    fresh.do("sample")
    assert fresh.shoot()[20:44].mean() == pytest.approx(0, abs=1), "nothing charged it"


def test_a_blank_is_in_the_door_and_does_not_glow() -> None:
    bench = Darkroom(door={}, initial={"concentration": 0.5})
    bench.do("blank")
    bench.charge(60.0)
    bench.swing(DOOR.open)
    assert bench.shoot()[20:44].mean() == pytest.approx(0, abs=1)
    bench.do("sample")
    left = bench.shoot()[20:44].mean()
    assert left > 100, "the samples were not lost, only put away"
    reference = Darkroom(door={}, initial={"concentration": 0.5})
    reference.clock.spend(bench.clock.now() - 1.5)
    reference.swing(DOOR.open)
    assert left == pytest.approx(reference.shoot()[20:44].mean(), rel=0.02), "in the dark"


def test_a_fresh_sample_takes_the_cards_away_and_does_not_glow() -> None:
    bench = Darkroom(initial={"concentration": 0.5})
    bench.do("blank", "fresh sample")
    assert bench.arranged.card == "sample"
    assert bench.shoot()[20:44].mean() == pytest.approx(0, abs=1)


def test_a_colorchecker_has_its_patches_row_by_row() -> None:
    """What the camera sees is ∫ lamp × reflectance × sensitivity, relative to the white patch."""
    colour = colour_science.load()

    bench = lit("colorchecker", chart=[0, 0, 96, 64], seed=3)
    cells = colours(bench.shoot(1 / 100, 100, 5.6))
    seen = np.array([cells[3 + 8 * (n // 6) : 6 + 8 * (n // 6), 3 + 8 * (n % 6) : 6 + 8 * (n % 6)]
                     .mean(axis=(0, 1)) for n in range(24)])  # fmt: skip
    patches = colour.SDS_COLOURCHECKERS["BabelColor Average"].values()
    reflectance = np.array([np.interp(WAVELENGTH_NM, p.wavelengths, p.values) for p in patches])
    sensitivity = bent_curves(np.random.default_rng([3, 0])).sensitivity
    expected = reflectance * filament_spectrum(BURNING_K) @ sensitivity.T
    assert seen / seen[18] == pytest.approx(expected / expected[18], rel=0.15, abs=0.01)


def test_a_colorchecker_lies_in_its_region_only() -> None:
    found = surfaces("colorchecker", (24, 16, 48, 32), 96, 64)
    assert set(np.unique(found)) == set(range(2 + ROWS * COLUMNS))
    assert not found[:16].any()
    assert found[16:48, 24:72].all()
    assert (found == 1).sum() == pytest.approx((48 / 6 * 0.76) ** 2, rel=0.3)
