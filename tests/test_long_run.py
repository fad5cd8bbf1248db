"""A process that records for hours is judged by its growth alone."""

from dataclasses import replace

import pytest

from tests.acceptance.long_run import PICTURE_MB, Growth, Reading

#: Two hours and a day of frames every 30 s: journal and records take 2.6 bytes a byte.
EARLY = Reading(240, 2.3, 174.0, 7, 2, 0.2)
LATE = Reading(2880, 24.2, 180.2, 7, 2, 2.6)


@pytest.mark.parametrize("elsewhere_mb", [-80.0, 0.0, 25.0, 400.0])
def test_memory_of_another_computer_is_no_verdict(elsewhere_mb: float) -> None:
    early, late = (replace(one, memory_mb=one.memory_mb + elsewhere_mb) for one in (EARLY, LATE))
    assert not Growth(early, late).wrong
    assert str(Growth(early, late)) == str(Growth(EARLY, LATE))


def test_a_part_of_each_picture_that_stays_is_seen() -> None:
    leak_mb = 0.4 * PICTURE_MB * (LATE.frames - EARLY.frames)
    assert Growth(EARLY, replace(LATE, memory_mb=LATE.memory_mb + leak_mb)).wrong


@pytest.mark.parametrize("kind", ["files", "threads"])
def test_a_file_or_thread_that_stays_is_seen(kind: str) -> None:
    assert Growth(EARLY, replace(LATE, **{kind: 9})).wrong
    assert not Growth(EARLY, replace(LATE, **{kind: 1})).wrong
