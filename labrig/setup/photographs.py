"""What the photographs of a rig check tell: the noise of a dark frame, whether it is turned."""

import io
import logging
from typing import Any

from labrig.acquire import Exercised, Finding, Frame, Measured
from labrig.reduce import FrameMeasurement, measure, read_raw
from labrig.setup.picture_stats import decode

#: Mean above black, as a part of the range, from which on a frame is not dark.
LIGHT = 0.005
#: EXIF orientation of a picture that was not turned.
UPRIGHT = 1


class Photographs:
    """The eyes of a rig check: reads RAW frames and live pictures."""

    def dark_frame(self, frame: Frame) -> Exercised:
        """Its noise, whether it is dark, whether it is turned."""
        reduced = measure(read_raw(frame.data, "the dark frame"))
        return Exercised(
            tuple(_noise(reduced, frame)), (_darkness(reduced), _orientation(frame.data))
        )

    def live_picture(self, jpeg: bytes) -> Measured:
        """Its size."""
        height, width, _ = decode(jpeg).shape
        return Measured("live picture", f"{width} x {height} pixels, {len(jpeg) / 1e3:.1f} kB")


def _noise(reduced: FrameMeasurement, frame: Frame) -> list[Measured]:
    return [
        Measured(
            f"dark frame {frame.settings}, {name}",
            f"mean {stats.mean:.2f} ± {stats.sigma:.3f} DN above black, std {stats.std:.2f} DN, "
            f"{stats.hot} hot, {stats.saturated} clipped of {stats.n}",
        )
        for name, stats in reduced.channels.items()
    ]


def _darkness(reduced: FrameMeasurement) -> Finding:
    limit_dn = LIGHT * (reduced.white - min(reduced.black))
    brightest_dn = max(stats.mean for stats in reduced.channels.values())
    if brightest_dn > limit_dn:
        return Finding(
            "warn",
            f"with the lamp off a frame is not dark ({brightest_dn:.0f} DN above black)",
            "darken the room, cover displays, and let the samples fade",
        )
    return Finding("fine", "with the lamp off a frame is dark")


def _orientation(content: bytes) -> Finding:
    """Auto rotate: no known property tells it, a turned frame does."""
    import exifread

    # it warns through logging of every odd tag
    logging.getLogger("exifread").setLevel(logging.CRITICAL)
    try:
        tags: dict[str, Any] = exifread.process_file(io.BytesIO(content), details=False)
    except Exception:  # damaged EXIF fails in any way
        return Finding(
            "warn",
            "the frame's EXIF cannot be read, and so not whether it is turned",
            "see that auto rotate is off",
        )
    tag = tags.get("Image Orientation")
    if tag is None or list(tag.values) == [UPRIGHT]:
        return Finding("fine", "frames are not marked as turned")
    return Finding(
        "refuse",
        "auto rotate is on: it marks frames as turned, some this way and some that",
        "Set-up 1 (yellow) → Auto rotate → Off",
    )
