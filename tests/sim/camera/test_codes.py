import math
from itertools import pairwise

import pytest

from labrig.sim.camera import codes

LABELS_S = {0x10: 30, 0x13: 25, 0x15: 20, 0x38: 1, 0x3B: 0.8, 0x68: 1 / 60, 0x70: 1 / 125}


@pytest.mark.parametrize(("code", "label_s"), LABELS_S.items())
def test_true_exposures_are_near_their_labels(code: int, label_s: float) -> None:
    assert codes.exposure_s(code) == pytest.approx(label_s, rel=0.07)


def test_whole_stops_are_exact_powers_of_two() -> None:
    assert [codes.exposure_s(code) for code in (0x10, 0x38, 0x68, 0xA0)] == [32, 1, 2**-6, 2**-13]
    assert [codes.f_number(code) for code in (0x28, 0x38)] == [4, 8]


def test_three_codes_a_stop_and_each_a_third_apart() -> None:
    timed = codes.TV_CODES[1:]
    steps = [codes.exposure_s(a) / codes.exposure_s(b) for a, b in pairwise(timed)]
    assert steps == pytest.approx([2 ** (1 / 3)] * len(steps))
    assert len(timed) == 3 * 18 + 1


def test_apertures_and_sensitivities_match_the_dial() -> None:
    apertures = {0x15: 1.8, 0x20: 2.8, 0x25: 3.5, 0x30: 5.6, 0x40: 11, 0x50: 22}
    for code, label in apertures.items():
        assert codes.f_number(code) == pytest.approx(label, rel=0.04)
    marked = {0x48: 100, 0x4B: 125, 0x50: 200, 0x60: 800, 0x63: 1000, 0x65: 1250, 0x78: 6400}
    assert {code: codes.iso(code) for code in marked} == marked
    assert len({codes.iso(code) for code in codes.ISO_CODES}) == len(codes.ISO_CODES) == 19


def test_bulb_has_no_end() -> None:
    assert codes.exposure_s(codes.TV_BULB) == math.inf
