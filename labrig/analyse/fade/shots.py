"""What photographs after a switch hold, as time for which the steady lamp would give as much."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.timed_frames import switched_time, timed, untimed
from labrig.calibration import CameraFile
from labrig.errors import DataError
from labrig.record import FrameRecord, RunRecord
from labrig.reduce import reduce_patches
from labrig.region import Region
from labrig.results import Series

FloatArray = NDArray[np.float64]

#: Of a change, fewer tell nothing.
FEWEST = 6


@dataclass(frozen=True, eq=False)
class Shots:
    """n photographs after a switch, seen in S places or colours.

    Attributes
    ----------
    start_s, exposure_s
        (n,) begins after the switch as recorded, and shutter times.
    value, sigma
        (n, S) ∫ of the share of the steady lamp over the exposure, in s; NaN where it clips.
    steady
        (S,) signal of the steady lamp, DN/s.
    """

    start_s: FloatArray
    exposure_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    steady: FloatArray

    def brightest(self, channels: int) -> NDArray[np.intp]:
        """Column of the brightest channel in every place, (S / channels,)."""
        places = self.steady.reshape(-1, channels)
        columns: NDArray[np.intp] = np.arange(len(places)) * channels + places.argmax(axis=1)
        return columns

    def of(self, columns: NDArray[np.intp]) -> "Shots":
        """Some of the places or colours."""
        return Shots(
            self.start_s,
            self.exposure_s,
            self.value[:, columns],
            self.sigma[:, columns],
            self.steady[columns],
        )


def shots_after(
    run: RunRecord,
    frames: Sequence[FrameRecord],
    darks: Sequence[FrameRecord],
    places: Mapping[str, Region],
    camera: CameraFile | None,
    purpose: str,
) -> Shots:
    """Photographs of a `purpose`, `fade` or `rise`, over those of the steady lamp in their pass.

    Parameters
    ----------
    frames
        Of that purpose, and those called `steady`.
    places
        Regions that are seen, by name.

    Raises
    ------
    DataError
        Too few of them are of any use.
    """
    state = "on" if purpose == "rise" else "off"
    attempts = run.completed()
    taken = [
        timed(frame, switched_time(attempts[frame.unit], frame, state))
        for frame in frames
        if frame.purpose == purpose
    ]
    steady = [untimed(frame) for frame in frames if frame.purpose == "steady"]
    if len(taken) < FEWEST or not steady:
        raise DataError(
            f"expected {FEWEST} photographs of the {purpose} or more, and of the steady lamp, got "
            f"{len(taken)} and {len(steady)}; resume the run"
        )
    dark = [untimed(frame) for frame in darks]
    series = reduce_patches([*taken, *steady], places, dark, camera=camera)
    parts = [_of_place(one, len(taken)) for one in series.values()]
    value, sigma = (np.hstack([part[number] for part in parts]) for number in (0, 1))
    first = next(iter(series.values()))
    found = Shots(
        first.t_s[: len(taken)],
        first.exposure_s[: len(taken)],
        value,
        sigma,
        np.concatenate([part[2] for part in parts]),
    )
    seen = np.isfinite(found.value).any(axis=1)
    if np.count_nonzero(seen) < FEWEST:
        raise DataError(
            f"expected {FEWEST} photographs of the {purpose} that do not clip, got "
            f"{np.count_nonzero(seen)}; lower camera.iso"
        )
    return Shots(
        found.start_s[seen], found.exposure_s[seen], value[seen], sigma[seen], found.steady
    )


def _of_place(series: Series, taken: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Values and σ of the photographs that were taken, (n, C) each, and the steady signal (C,)."""
    unit = np.array(series.unit)
    is_steady = np.arange(len(unit)) >= taken
    value, sigma = np.full((2, taken, len(series.channels)), np.nan)
    for one in dict.fromkeys(series.unit):
        reference = is_steady & (unit == one) & series.usable
        own = np.flatnonzero(~is_steady & (unit == one) & series.usable)
        if not reference.any() or not len(own):
            continue
        level = series.values[reference].mean(axis=0)
        exposure_s = series.exposure_s[own][:, np.newaxis]
        known = level > 0
        safe = np.where(known, level, 1.0)
        value[own] = np.where(known, series.values[own] * exposure_s / safe, np.nan)
        sigma[own] = np.where(known, series.sigma[own] * exposure_s / safe, np.nan)
    steady = series.values[is_steady & series.usable]
    if not len(steady):
        raise DataError("the steady lamp clips in all frames; lower camera.iso")
    return value, sigma, steady.mean(axis=0)
