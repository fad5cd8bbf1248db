"""What the simulated spectrometer faces: white beside the samples, the grey card, or a sample."""

import numpy as np
import pytest

from labrig.foundation.clock import VirtualClock
from labrig.foundation.errors import UsageError
from labrig.material import read_any_material
from labrig.sim.cards import reflectances
from labrig.sim.room import Room
from labrig.sim.simulation import Simulation
from labrig.sim.surfaces import Surfaces

LED = {"relay": 1, "centre": 455.0, "fwhm": 20.0}
MATERIALS = ("yellow-textile", "grey-felt")


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def room(clock: VirtualClock) -> Room:
    sample = [{"material": name, "region": [0.1 + 0.4 * n, 0.1, 0.3, 0.8]}
              for n, name in enumerate(MATERIALS)]  # fmt: skip
    description = {"sample": sample, "leds": [LED], "sensor": {"width": 96, "height": 64}}
    made = Room(Simulation.model_validate(description), clock)
    made.switch_led(1, on=True)
    clock.spend(10.0)
    return made


def test_the_arrangement_decides_what_the_spectrometer_sees(
    room: Room, clock: VirtualClock
) -> None:
    light = room.white_exposure(5.0, 6.0)
    assert room.spectrometer_exposure(5.0, 6.0) == pytest.approx(light)
    room.tasks["grey card"]()
    clock.spend(1.0)
    card = reflectances("grey card", 0.18)[1]
    assert room.spectrometer_exposure(10.2, 10.4) == pytest.approx(
        card * room.white_exposure(10.2, 10.4)
    )
    for number, name in enumerate(MATERIALS, start=1):
        room.tasks["sample NUMBER"](str(number))
        begin_s = clock.now()
        clock.spend(1.0)
        (expected,) = Surfaces([read_any_material(name)], 0.0).thrown_back(
            room.white_exposure(begin_s, begin_s + 1.0), np.array([1])
        )
        assert room.spectrometer_exposure(begin_s, begin_s + 1.0) == pytest.approx(expected)
    # The first sample for half of the time, white for the rest.
    room.tasks["sample"]()
    now_s = clock.now()
    clock.spend(1.0)
    mixed = room.spectrometer_exposure(now_s - 1.0, now_s + 1.0)
    parts = [room.spectrometer_exposure(now_s - 1.0, now_s), room.white_exposure(now_s, now_s + 1)]
    assert mixed == pytest.approx(sum(parts))


@pytest.mark.parametrize("number", ["0", "3", "x", "-1"])
def test_there_are_no_more_samples_than_those_of_the_room(room: Room, number: str) -> None:
    with pytest.raises(UsageError, match="expected a sample from 1 to 2"):
        room.tasks["sample NUMBER"](number)
