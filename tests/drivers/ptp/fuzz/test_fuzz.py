"""Some harmed containers each way; `tests.acceptance.ptp_fuzz` does 10⁵."""

import pytest

from .sessions import WAYS, Tally, sessions

CASES = 350
FIRST = next(iter(WAYS))


@pytest.mark.parametrize(
    "way",
    [FIRST, *(pytest.param(way, marks=pytest.mark.campaign) for way in WAYS if way != FIRST)],
)
def test_harmed_containers_end_in_one_helpful_line_and_the_camera_works_again(way: str) -> None:
    tally = Tally()
    failures = [failure for failure in sessions(way, CASES, 2, tally) if failure]
    assert not failures
    assert tally.cases.total() >= CASES
    assert tally.refused
    assert min(tally.sessions["eos"], tally.sessions["standard"], tally.bulbs) > 0
    assert tally.attempts[0] == 0, "it gave up"
