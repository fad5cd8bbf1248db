"""The frames of a camera calibration, reduced."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.camera_calibration.factors import CardFrame
from labrig.analyse.camera_calibration.linearity import deviation, fit_linearity
from labrig.analyse.camera_calibration.photon_transfer import (
    PhotonTransfer,
    Scatter,
    pairs_of,
    photon_transfer,
    scatter,
)
from labrig.analyse.timed_frames import timed, untimed
from labrig.calibration import Linearity
from labrig.errors import DataError
from labrig.record import FrameRecord
from labrig.reduce import measure, read_raw, reduce_patches
from labrig.region import Region

FloatArray = NDArray[np.float64]

#: Share of a region's pixels that may clip in a photon transfer.
CLIPPED_SHARE = 1e-3
#: Where a sensor is further from a straight line, its frames tell nothing of a shutter.
MOST_BENT = 0.02


@dataclass(frozen=True, eq=False)
class CardLevels:
    """The card in n frames of C channels.

    Attributes
    ----------
    level, sigma
        (n, C) DN above dark.
    usable
        (n,) whether nothing clips.
    """

    frames: tuple[FrameRecord, ...]
    channels: tuple[str, ...]
    level: FloatArray
    sigma: FloatArray
    usable: NDArray[np.bool_]

    def linearity(
        self, iso: float, range_dn: float, saturation_dn: float | None
    ) -> Linearity | None:
        """From the frames at one ISO."""
        rows = self.usable & np.array([frame.iso == iso for frame in self.frames])
        stops = [frame.f_number for frame in self.frames]
        known = list(dict.fromkeys(stops))
        group = np.array([known.index(stop) for stop in stops], dtype=np.intp)
        level = np.where(rows[:, np.newaxis], self.level, np.nan)
        return fit_linearity(level, self.sigma, group, range_dn, saturation_dn)

    def card_frames(self, purposes: Sequence[str], linearity: Linearity | None) -> list[CardFrame]:
        """What brackets and repeats show, put right for what is not linear."""
        bent = deviation(linearity, self.level)
        straight = self.level * np.exp(-bent)
        used = self.usable & (np.abs(bent).max(axis=1) < MOST_BENT)
        light, noise = straight.sum(axis=1), np.sqrt(np.square(self.sigma).sum(axis=1))
        return [
            CardFrame(
                frame.unit, frame.purpose, frame.start_time, frame.exposure_s, frame.iso,
                frame.f_number, float(np.log(light[row])), float(noise[row] / light[row]),
            )
            for row, frame in enumerate(self.frames)
            if frame.purpose in purposes and used[row] and light[row] > 0
        ]  # fmt: skip


def card_levels(
    lit: Sequence[FrameRecord], darks: Sequence[FrameRecord], card: Region
) -> CardLevels:
    """Reduce all lit frames in the card's region.

    Raises
    ------
    DataError
        There are none, or no dark frames at their ISO.
    """
    if not lit:
        raise DataError("expected frames of the lit card, got none; resume the run")
    frames = [
        replace(
            timed(frame, lit[0].start_time),
            unit=f"{frame.unit} ISO {frame.iso} f/{frame.f_number}",
        )
        for frame in lit
    ]
    dark = [untimed(frame) for frame in darks]
    series = reduce_patches(frames, {"card": card}, dark)["card"]
    exposure_s = series.exposure_s[:, np.newaxis]
    return CardLevels(
        tuple(lit),
        series.channels,
        series.values * exposure_s,
        series.sigma * exposure_s,
        series.usable,
    )


def transfer(
    iso: float, lit: Sequence[FrameRecord], darks: Sequence[FrameRecord], card: Region
) -> PhotonTransfer:
    """Photon transfer at one ISO.

    Raises
    ------
    DataError
        Too few frames.
    """
    shortest_s = min((frame.exposure_s for frame in darks if frame.iso == iso), default=0.0)
    dark = [frame for frame in darks if frame.iso == iso and frame.exposure_s == shortest_s]
    dark_dn = float(np.mean(dark_levels(dark, card))) if dark else 0.0
    own = [frame for frame in lit if frame.iso == iso]
    return photon_transfer(
        iso, _scatters(pairs_of(own), card, dark_dn), _scatters(pairs_of(dark), card, dark_dn)
    )


def dark_levels(darks: Sequence[FrameRecord], card: Region) -> FloatArray:
    """Mean of each channel above black, (channels,)."""
    measured = [measure(read_raw(frame.path), card) for frame in darks]
    levels = [[channel.mean for channel in one.channels.values()] for one in measured]
    mean: FloatArray = np.mean(levels, axis=0)
    return mean


def saturation(brightest: FrameRecord, card: Region) -> tuple[float, float | None]:
    """From black to white, and the level above black at which most of the card clips; or None."""
    seen = measure(read_raw(brightest.path), card)
    range_dn = seen.white - max(seen.black)
    clips = any(channel.saturated > channel.n / 2 for channel in seen.channels.values())
    return range_dn, range_dn if clips else None


def _scatters(
    pairs: Sequence[tuple[FrameRecord, FrameRecord]], card: Region, dark_dn: float
) -> list[Scatter]:
    found = []
    for one, other in pairs:
        first, second = read_raw(one.path), read_raw(other.path)
        seen = measure(first, card).channels.values()
        if all(channel.saturated <= CLIPPED_SHARE * channel.n for channel in seen):
            found.append(scatter(first, second, card, dark_dn))
    return found
