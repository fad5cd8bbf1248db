"""Vignetting of a lens at one aperture, from frames of an evenly lit card, and veiling glare."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.frame_times import timed, untimed
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CameraFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region, region_pixels
from labrig.optics import Flat, Glare, rho_squared
from labrig.protocols.camera_calibration.protocol import CardFrames
from labrig.protocols.camera_calibration.result import FittedFlat
from labrig.record import FrameRecord
from labrig.reduce import (
    FRAME_TILES,
    LinearFrame,
    RawFrame,
    StoredFrame,
    frame_series,
    reduce_frames,
    reduce_patches,
)

#: Blocks across and down the card whose means are fitted.
BLOCKS = (16, 12)
#: Significance in σ from which the ρ⁴ term is kept.
EVIDENT_SIGMAS = 4.0


def fit_flat(
    frames: Sequence[StoredFrame], card: Region, dark_dn: FloatArray, f_number: float | None
) -> FittedFlat:
    """Fit A (1 + g·x + c₁ρ² + c₂ρ⁴) to blocks of the card by least squares, channel by channel.

    Parameters
    ----------
    frames
        Frames of the card on disk.
    card
        Region of the card in fractions of the frame.
    dark_dn
        Dark level above black in DN, shape (channels,).
    f_number
        F-number of the frames; None if the lens has none.

    Raises
    ------
    DataError
        There are no frames, or the card is not lit.
    """
    if not frames:
        raise DataError("expected frames of the lit card, got none")
    blocks = reduce_frames(frames, MeasureBlocks(card, dark_dn))
    first, light = blocks[0], np.mean([frame.light_dn for frame in blocks], axis=0)
    fits = [
        _fit_channel(first.x, first.y, channel_light, first.width, first.height)
        for channel_light in light.T
    ]
    powers = max(fit.powers for fit in fits)
    flat = Flat(
        f_number=f_number,
        falloff=tuple(tuple(fit.falloff[:powers].tolist()) for fit in fits),
        gradient=tuple((float(fit.gradient[0]), float(fit.gradient[1])) for fit in fits),
        sigma=float(np.sqrt(np.mean([fit.rms**2 for fit in fits]))),
    )
    return FittedFlat(flat, np.array([f.rho2 for f in fits]), np.array([f.light for f in fits]))


class _ChannelFit(NamedTuple):
    """Fit of one channel; `light` is that of the blocks over the centre's, without the gradient."""

    falloff: FloatArray
    powers: int
    gradient: FloatArray
    rms: float
    rho2: FloatArray
    light: FloatArray


@dataclass(frozen=True, eq=False)
class CardBlocks:
    """Light of blocks of the card in one frame.

    Attributes
    ----------
    width, height
        Size of the frame in pixels.
    x, y
        Centres of the blocks in pixels, shape (blocks,).
    light_dn
        Light of the blocks in DN, shape (blocks, channels).
    """

    width: int
    height: int
    x: FloatArray
    y: FloatArray
    light_dn: FloatArray


@dataclass(frozen=True, eq=False)
class MeasureBlocks:
    """Measurement of blocks of the card in one frame.

    Attributes
    ----------
    card
        Region of the card in fractions of the frame.
    dark_dn
        Dark level above black in DN, shape (channels,).
    """

    card: Region
    dark_dn: FloatArray

    def __call__(self, frames: Iterator[RawFrame]) -> CardBlocks:
        """Measure the blocks in the frame."""
        raw = next(frames)
        left, top, width, height = region_pixels(self.card, raw.width, raw.height)
        across = _block_edges(left, width, BLOCKS[0], raw.cfa_side)
        down = _block_edges(top, height, BLOCKS[1], raw.cfa_side)
        linear = LinearFrame(raw, self.dark_dn)
        light = [
            linear.sums((near, low, far - near, high - low)).mean_dn
            for low, high in pairwise(down.tolist())
            for near, far in pairwise(across.tolist())
        ]
        x, y = np.meshgrid((across[1:] + across[:-1]) / 2, (down[1:] + down[:-1]) / 2)
        return CardBlocks(raw.width, raw.height, x.ravel(), y.ravel(), np.array(light))


def _block_edges(start: int, length: int, blocks: int, side: int) -> NDArray[np.intp]:
    """Return the edges of blocks of whole cells of the colour filter, one cell wide at least."""
    cells = length // side
    return start + side * np.linspace(0, cells, min(blocks, cells) + 1).round().astype(np.intp)


def _fit_channel(
    x: FloatArray, y: FloatArray, light: FloatArray, width: int, height: int
) -> _ChannelFit:
    if not light.mean() > 0:
        raise DataError("expected a lit card, got a dark one; is 'card:' its region?")
    rho2 = rho_squared(x, y, width, height)
    half = float(np.hypot(width, height)) / 2
    odd = np.stack([(x - width / 2) / half, (y - height / 2) / half], axis=1)
    for powers in (2, 1):
        even = rho2[:, np.newaxis] ** np.arange(1, powers + 1)
        design = np.hstack([np.ones((len(x), 1)), odd, even])
        coefficients, *_ = np.linalg.lstsq(design, light)
        residual = light - design @ coefficients
        variance = float(residual @ residual) / max(len(light) - len(coefficients), 1)
        sigma = float(np.sqrt(np.linalg.inv(design.T @ design)[-1, -1] * variance))
        if abs(coefficients[-1]) > EVIDENT_SIGMAS * sigma:
            break
    middle, gradient = float(coefficients[0]), coefficients[1:3] / coefficients[0]
    falloff = np.zeros(2)
    falloff[:powers] = coefficients[3:] / middle
    flat_light = light / middle - odd @ gradient
    return _ChannelFit(
        falloff, powers, gradient, float(np.sqrt(variance)) / middle, rho2, flat_light
    )


BLACK = "black"
#: Glare above which the trap is no trap.
NOT_BLACK = 0.2


def measure_glare(
    context: AnalysisContext,
    camera: CameraFile,
    lit: Sequence[FrameRecord],
    darks: Sequence[FrameRecord],
) -> Glare | None:
    """Return the signal of the trap over the frame's mean signal; None without a trap.

    Parameters
    ----------
    part
        Part of a run.
    camera
        The calibration without glare, whose flat fields are divided out.
    lit, darks
        Frames of the lit card, and dark frames.

    Raises
    ------
    DataError
        The place of the trap is not black.
    """
    black = context.protocol.black
    if black is None:
        return None
    flats = [frame for frame in lit if frame.role == CardFrames.FLAT]
    series = reduce_patches(
        [timed(frame, flats[0].start_time) for frame in flats],
        {BLACK: black, **FRAME_TILES},
        [untimed(frame) for frame in darks],
        camera=camera,
    )
    frame_light = frame_series([series[name] for name in FRAME_TILES]).values
    fraction = series[BLACK].values / frame_light
    dark_sigma = np.nan_to_num(series[BLACK].dark_sigma / frame_light.mean(axis=0))
    # A lens's glare is not quite the same at all apertures and in all channels.
    sigma = float(np.hypot(fraction.std(), dark_sigma.mean()))
    mean = float(fraction.mean())
    if mean > NOT_BLACK:
        raise DataError(
            f"black: expected a black trap, got {100 * mean:.0f} % of the frame's mean light "
            "there; change black: or leave it out"
        )
    return Glare(fraction=max(mean, 0.0), sigma=sigma)
