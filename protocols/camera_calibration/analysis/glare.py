"""Veiling glare of a lens: what it shows of a black trap in a frame of the lit card."""

from collections.abc import Sequence

import numpy as np

from labrig.analyse.frames import timed, untimed
from labrig.analyse.inputs import Part
from labrig.calibration import CameraFile
from labrig.foundation.errors import DataError
from labrig.optics import Glare
from labrig.protocols.camera_calibration.protocol import CardFrames
from labrig.record import FrameRecord
from labrig.reduce import FRAME_TILES, frame_series, reduce_patches

BLACK = "black"
#: Glare above which the trap is no trap.
NOT_BLACK = 0.2


def measure_glare(
    part: Part, camera: CameraFile, lit: Sequence[FrameRecord], darks: Sequence[FrameRecord]
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
    black = part.protocol.black
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
