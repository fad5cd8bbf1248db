"""Reference source in two runs, which gives the ratio of sensitivities of camera and geometry."""

import math
from pathlib import Path

import numpy as np

from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.yaml_file import did_you_mean
from labrig.results import FittedDecay, Measured, read_fitted_decays, read_series


def gain(a: Path, b: Path, name: str, channel: str) -> Measured:
    """Return the signal of the patch `name` in run A over that in run B, in one channel.

    The signal of a reference that decays is the sum of its amplitudes; that of a steady one,
    without a fitted decay, is the mean of its frames.

    Raises
    ------
    UsageError
        If the patch is not in both runs, or decays in one of them only.
    DataError
        If the patch is dark, or its series is damaged.
    """
    shared = [patch for patch in _patches(a) if patch in _patches(b)]
    if name not in shared:
        hint = did_you_mean(name, shared) if shared else "they share none"
        raise UsageError(
            f"--reference {name}: expected a patch of its own, in both runs, with a source that "
            f"is the same on both days; {hint}"
        )
    fits = [read_fitted_decays(run / "result").get(name) for run in (a, b)]
    if (fits[0] is None) != (fits[1] is None):
        raise UsageError(
            f"--reference {name}: it decays in one run and is steady in the other; expected a "
            "source that is the same on both days"
        )
    signal_a, signal_b = (
        _steady(run, name, channel) if fit is None else _glow(fit, channel)
        for run, fit in zip((a, b), fits, strict=True)
    )
    for run, signal in ((a, signal_a), (b, signal_b)):
        if not signal.value > DETECTION_SIGMA * signal.sigma:
            raise DataError(
                f"--reference {name}: expected light in {channel} that stands out by "
                f"{DETECTION_SIGMA:g} σ, got {signal.value:.3g} ± {signal.sigma:.2g} DN/s in {run}"
            )
    return signal_a.over(signal_b)


def _patches(run: Path) -> list[str]:
    """Return the names of the patches with result folders of their own, fitted or not."""
    return sorted(path.parent.name for path in (run / "result").glob("*/series.csv"))


def _glow(fit: FittedDecay, channel: str) -> Measured:
    """Return the sum of all amplitudes in DN/s, their σ taken as independent."""
    amplitudes = fit.amplitudes_in(channel)
    return Measured(
        sum(amplitude.value for amplitude in amplitudes),
        math.hypot(*(amplitude.sigma for amplitude in amplitudes)),
    )


def _steady(run: Path, name: str, channel: str) -> Measured:
    """Return the mean of a channel in DN/s, with σ by its scatter from frame to frame."""
    path = run / "result" / name / "series.csv"
    parts = [part for part in read_series(path) if channel in part.channels]
    columns = [part.values[part.usable, part.channels.index(channel)] for part in parts]
    values = np.concatenate([*columns, []])
    if len(values) < 2:
        raise DataError(f"{path}: expected usable frames with a channel {channel}, got too few")
    scatter = values.std(ddof=1) / math.sqrt(len(values))
    return Measured(float(values.mean()), float(scatter))
