"""Random spacing of frames: what the begins keep, how little of a beat they leave, and the seed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from labrig.acquire import plan, read_protocol, read_rig_file
from labrig.protocols.steps.random_spacing import RandomSpacing
from labrig.record import read_run
from tests.conftest import Ended

SEEDS = st.integers(0, 2**32 - 1)


@given(
    first_s=st.floats(0, 10),
    frames=st.integers(2, 60),
    every_s=st.floats(0.1, 100),
    spent=st.floats(0, 1.2),
    exposures=st.lists(st.floats(0, 1), min_size=60, max_size=60),
    seed=SEEDS,
)
def test_begins_keep_the_ends_and_leave_every_exposure_its_time(
    first_s: float,
    frames: int,
    every_s: float,
    spent: float,
    exposures: list[float],
    seed: int,
) -> None:
    even_s = [first_s + every_s * number for number in range(frames)]
    exposures_s = [every_s * exposure for exposure in exposures[:frames]]
    begins_s = RandomSpacing(every_s, spent * every_s).begins_s(even_s, exposures_s, seed)
    assert (begins_s[0], begins_s[-1], len(begins_s)) == (even_s[0], even_s[-1], frames)
    least_s = np.minimum(np.array(exposures_s[:-1]) + spent * every_s, every_s)
    assert np.all(np.diff(begins_s) >= least_s - 1e-9 * (first_s + every_s * frames))


@pytest.mark.parametrize("exposure_s", [0.1, 1.0, 1.6, 2.5])
def test_the_beat_that_is_said_to_be_left_is_that_of_many_draws(exposure_s: float) -> None:
    spacing, even_s = RandomSpacing(5.0, 1.7), (0.5 + 5 * np.arange(36)).tolist()
    draws = [spacing.begins_s(even_s, [exposure_s] * 36, seed) for seed in range(300)]
    phase = 2j * np.pi * np.linspace(0.1, 0.5, 201)
    left = np.array([np.exp(np.multiply.outer(phase, begins)).mean(axis=1) for begins in draws])
    averaged = np.abs(np.sinc(phase.imag / (2 * np.pi) * exposure_s))
    worst = (np.sqrt((np.abs(left) ** 2).mean(axis=0)) * averaged).max()
    assert spacing.beat_left(exposure_s, 36) == pytest.approx(worst, rel=0.2)
    assert spacing.beat_left(exposure_s, 36) < 0.5 * spacing.beat_of_even(exposure_s)


def test_frames_without_time_to_spare_stay_even() -> None:
    spacing = RandomSpacing(5.0, 1.7)
    assert spacing.begins_s([0.5, 5.5, 10.5], [3.4] * 3, 1) == [0.5, 5.5, 10.5]
    assert spacing.beat_left(3.4, 36) == spacing.beat_of_even(3.4) == pytest.approx(0.395, abs=1e-3)


def test_a_plan_takes_as_long_and_says_what_is_left(
    labrig: Callable[..., Ended], make_protocol: Callable[..., Path], make_rig: Callable[..., Path]
) -> None:
    rig = make_rig()
    durations_s = [
        plan(read_protocol(make_protocol(spacing=spacing)), read_rig_file(rig), str(rig)).duration_s
        for spacing in ("random", "even")
    ]
    assert durations_s[0] == pytest.approx(durations_s[1], abs=1e-6)
    ended = labrig("plan", make_protocol(), "--rig", rig)
    assert "random, every 5 s in the mean and at least" in ended.out
    ended = labrig("plan", make_protocol(spacing="even"), "--rig", rig)
    assert "even, every 5 s" in ended.out


def test_the_seed_is_in_the_journal_and_gives_the_begins(
    labrig: Callable[..., Ended],
    make_rig: Callable[..., Path],
    make_protocol: Callable[..., Path],
    tmp_path: Path,
) -> None:
    """Each of two repeats has its own."""
    ended = labrig(
        "run", make_protocol(repeats=2, exposure="0.5 s"), "--rig", make_rig(), "--no-process",
        "--runs", tmp_path / "runs",
    )  # fmt: skip
    assert ended.code == 0, ended.err
    run = read_run(ended.run_folder)
    text = "seed of begins of frames: "
    seeds = {
        action.unit: int(action.action.removeprefix(text))
        for attempt in run.completed().values()
        for action in attempt.actions
        if action.action.startswith(text)
    }
    assert len(set(seeds.values())) == 2
    spacing = RandomSpacing(5.0, 1.2 + 0.5)
    for unit, seed in seeds.items():
        frames = [frame for frame in run.frames("decay") if frame.unit == unit]
        even_s = [0.5 + 5 * number for number in range(len(frames))]
        begins_s = spacing.begins_s(even_s, [0.5] * len(frames), seed)
        measured_s = np.array([frame.start_time for frame in frames])
        lag_s = measured_s - begins_s
        assert np.ptp(lag_s) < 0.05
