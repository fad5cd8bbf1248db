"""Yarns under a light that is turned, samples put in anew, and spheres in the simulated room."""

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.sim.angles import Angles, Spheres
from labrig.sim.arrangement import Arrangement
from labrig.sim.simulation import Simulation
from tests.sim.darkroom import SMALL, Darkroom

CELLS = np.array([0, 1])


def room(**changed: object) -> Simulation:
    return Simulation.model_validate({**SMALL, **changed})


def test_re_radiation_is_the_same_at_all_angles_unless_told() -> None:
    turned = [Arrangement(light_deg=angle) for angle in (30, 45, 90, 120)]
    even = Angles(room(), CELLS)
    assert all((even.reradiated(arrangement) == 1.0).all() for arrangement in turned)
    uneven = Angles(room(reradiation_anisotropy=0.2), CELLS)
    kept = [float(uneven.reradiated(arrangement)[1, 0]) for arrangement in turned]
    assert kept == pytest.approx([0.9732, 0.9414, 0.8, 0.7], abs=1e-4)


def test_a_yarn_reflects_less_where_the_light_comes_from_the_side() -> None:
    angles = Angles(room(), CELLS)
    reflected = [
        float(angles.reflected(Arrangement(light_deg=angle))[1, 0]) for angle in (30, 45, 105)
    ]
    assert reflected[0] > reflected[1] == 1.0 > reflected[2] > 0.3


def test_placings_scatter_as_told_and_are_skewed() -> None:
    angles = Angles(room(repositioning=0.01), CELLS)
    assert (angles.reradiated(Arrangement()) == 1.0).all()
    placed = [
        float(angles.reradiated(Arrangement(placing=placing))[1, 0]) for placing in range(1, 2001)
    ]
    off = (np.array(placed) - 1) / 0.01
    assert off.mean() == pytest.approx(0.0, abs=0.1)
    assert off.std() == pytest.approx(1.0, abs=0.1)
    assert (off**3).mean() > 0.5
    assert float(angles.reflected(Arrangement(placing=7))[1, 0]) == placed[6]


def test_the_changer_puts_in_anew_and_turns_the_light_back() -> None:
    bench = Darkroom()
    bench.do("yarn vertical 60", "yarn horizontal 105")
    last = bench.room.arrangements.last
    assert (last.light_deg, last.placing) == (105, 2)
    bench.do("light back")
    assert bench.room.arrangements.last.light_deg == 45
    bench.do("sphere anew")
    assert bench.room.arrangements.last.placing == 3
    for wrong in ("yarn vertical 200", "yarn vertical askew"):
        with pytest.raises(UsageError, match="whole degrees from 0 to 150"):
            bench.do(wrong)


def test_a_sphere_is_lit_from_the_left_and_dark_around() -> None:
    sphere = {"material": "yellow-textile", "region": [0.25, 0.125, 0.5, 0.75], "shape": "sphere"}
    shading = Spheres(room(sample=[sphere]))
    reradiated, reflected = shading.reradiated, shading.reflected
    assert reradiated[32, 48] == pytest.approx(1.0, abs=0.03)
    assert (reradiated[0] == 1.0).all()
    assert reradiated[9, 25] == 0.0
    # Half a radius from the middle, light comes at 18° to the near side and at 82° to the far one,
    # which is 9 % farther away.
    near, far = reradiated[32, 48 - 12], reradiated[32, 48 + 12]
    expected = np.cos(np.radians(18.2)) / np.cos(np.radians(82.1)) * 1.09**2
    assert near / far == pytest.approx(expected, rel=0.02)
    rim = 24 + 2
    assert reflected[32, 48 + 12] / reradiated[32, 48 + 12] > 1.2
    lost = Spheres(room(sample=[sphere], reradiation_anisotropy=0.2)).reradiated
    assert lost[32, rim] / reradiated[32, rim] < 0.9
    assert lost[32, 48] / reradiated[32, 48] == pytest.approx(1.0, abs=0.01)
