"""The simulated sample changer: each sample has a charge of its own, and fades in the dark."""

from typing import Any

import numpy as np
import pytest

from labrig.foundation.errors import UsageError
from labrig.sim.simulation import Simulation
from tests.sim.darkroom import SMALL, Darkroom

AWAY_S, FIRST_S, SECOND_S = 1000e-6, 1300e-6, 1600e-6
REGION = [0.0, 0.1, 1.0, 0.8]


def places(**changed: Any) -> dict[str, Any]:
    return {
        "places": [
            {"pulse": "1300 us", "sample": [{"material": "blue-paint", "region": REGION}]},
            {"pulse": "1600 us", "sample": [{"material": "green-paint", "region": REGION}]},
        ],
        **changed,
    }


def changer(**changed: Any) -> Darkroom:
    """A room with two samples on a servo, none of them in place."""
    bench = Darkroom(sample=[], sample_changer=places(channel=3, travel="400 ms", **changed))
    bench.swing(AWAY_S)
    return bench


def glow(bench: Darkroom) -> float:
    """Signal of what is in place in the green channel, in DN/s."""
    start_s = bench.clock.now()
    bench.clock.spend(1.0)
    return float(bench.room.true_dn_per_s(start_s, 1.0)[0, 1])


def test_a_sample_that_is_taken_away_fades_in_the_dark_while_another_is_lit() -> None:
    bench, alone = changer(), Darkroom()
    bench.swing(FIRST_S)
    alone.clock.spend(1.0)
    assert bench.clock.now() == alone.clock.now()
    for room in (bench, alone):
        room.charge(60.0)
    lit = glow(bench), glow(alone)
    bench.swing(SECOND_S)
    assert glow(bench) == pytest.approx(0.0, abs=1e-9), "the second one was never lit"
    bench.charge(20.0)
    assert glow(bench) > 100.0
    bench.swing(FIRST_S)
    alone.clock.spend(bench.clock.now() - alone.clock.now())
    later = glow(bench), glow(alone)
    assert lit[0] == pytest.approx(lit[1], rel=1e-9)
    assert later[0] == pytest.approx(later[1], rel=1e-6)
    assert later[0] < 0.6 * lit[0]


def test_without_a_sample_in_place_nothing_glows_and_nothing_is_charged() -> None:
    bench = changer()
    bench.charge(60.0)
    assert np.quantile(bench.shoot(1.0), 0.99) < 40, "an empty holder is dark, but for hot pixels"
    bench.swing(FIRST_S)
    assert glow(bench) == pytest.approx(0.0, abs=1e-9)


def test_while_the_holder_moves_no_sample_is_in_the_light() -> None:
    bench = changer()
    bench.swing(FIRST_S)
    moving_s = bench.clock.now()
    bench.swing(SECOND_S)
    bench.swing(AWAY_S)
    arrangements = bench.room.arrangements
    seen = [arrangements.at(moving_s + t).in_place for t in (-0.05, 0.1, 0.39, 0.41, 0.49, 0.6)]
    assert seen == [1, 0, 0, 2, 2, 0]


def test_a_pulse_that_comes_while_the_servo_moves_ends_that_way() -> None:
    bench = changer()
    bench.swing(FIRST_S)
    start_s = bench.clock.now()
    bench.clock.spend(-0.3)  # the next pulse 200 ms after the last one
    bench.swing(SECOND_S)
    bench.clock.spend(0.5)
    seen = [bench.room.arrangements.at(start_s + t).in_place for t in (-0.2, 0.05, 0.15)]
    assert seen == [0, 0, 2]


def test_light_that_leaks_charges_the_samples_that_rest() -> None:
    glows = []
    for leak in ("0 %", "1 %"):
        bench = changer(leak=leak)
        bench.swing(FIRST_S)
        bench.charge(60.0)
        bench.swing(SECOND_S)
        glows.append(glow(bench))
    assert glows[0] == pytest.approx(0.0, abs=1e-9)
    assert glows[1] > 1.0


def test_a_holder_that_obeys_lines() -> None:
    bench = Darkroom(sample=[], sample_changer=places())
    bench.do("holder 2")
    bench.charge(20.0)
    green = glow(bench)
    assert green > 100.0
    bench.do("holder 1")
    assert glow(bench) == pytest.approx(0.0, abs=1e-9)
    bench.do("holder 0", "holder 2")
    assert 0.0 < glow(bench) < green
    for task in ("holder 3", "holder x"):
        with pytest.raises(UsageError, match="expected a place from 0 to 2"):
            bench.do(task)
    with pytest.raises(UsageError, match="there is none that obeys"):
        Darkroom().do("holder 1")


def test_truth_is_that_of_the_sample_in_place() -> None:
    bench = changer()
    bench.swing(SECOND_S)
    bench.charge(20.0)
    (patch,) = bench.room.truth().patches
    assert patch.material == "green-paint"
    assert patch.states[0].concentration is not None
    assert np.isclose(patch.states[0].concentration, 0.2, atol=0.05)


def test_a_room_has_a_table_or_a_changer() -> None:
    for content in ({**SMALL, "sample": []}, {**SMALL, "sample_changer": places()}):
        with pytest.raises(ValueError, match="at least 1 value in 'sample', or a 'sample_changer'"):
            Simulation.model_validate(content)
