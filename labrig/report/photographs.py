"""Conversion of RAW frames to small pictures for the page."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.errors import LabrigError, UsageError
from labrig.foundation.number_format import exposure_text, rounded
from labrig.foundation.region import region_pixels
from labrig.optics import CameraResponse, srgb_bytes
from labrig.record import FrameRecord, FrameRole
from labrig.reduce import (
    MakeThumbnail,
    Reduction,
    SaturatedFraction,
    Thumbnail,
    jpeg,
    png,
    reduce_frames,
    small,
)
from labrig.report.colours import Screen, into_gamut, screen_for
from labrig.report.report_model import GlowPhotograph, PatchReport

Reduced = TypeVar("Reduced")

DAYLIGHT_WIDTH = 1000
GLOW_WIDTH = 420
#: Width in pixels of the picture of a sample in a list of runs.
SAMPLE_WIDTH = 120
#: Largest fraction of saturated pixels in a well exposed daylight photograph; for display only.
CLIPPED_FRACTION = 0.002
#: Quantile of the pixels that is shown at full brightness, so that hot pixels have no influence.
BRIGHT_QUANTILE = 0.995
#: Linear level to which this quantile is scaled in a daylight photograph.
DAYLIGHT_BRIGHT = 0.8
#: Largest factor of brightening; beyond it there is only noise.
MAX_BRIGHTENED = 4096.0


@dataclass(frozen=True)
class Sensor:
    """Camera that took the frames.

    Attributes
    ----------
    camera
        Name of the camera, from make and model in the files.
    width, height
        Size of a frame in pixels.
    """

    camera: str
    width: int
    height: int


@dataclass(frozen=True)
class RegionMark:
    """Rectangle around a patch in a picture.

    Attributes
    ----------
    number
        Number of the patch, counted from 1.
    name
        Name of the patch.
    x, y, width, height
        Position of the upper left corner and size, in pixels of the picture.
    """

    number: int
    name: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Daylight:
    """Photograph of the sample under the lamp.

    Attributes
    ----------
    source
        Picture as data URI.
    width, height
        Size of the picture in pixels.
    marks
        Rectangles around the patches.
    caption
        Name, exposure and colours of the photograph.
    """

    source: str
    width: int
    height: int
    marks: tuple[RegionMark, ...]
    caption: str


@dataclass(frozen=True)
class GlowPicture:
    """Photograph of the glow, on the common scale and brightened.

    Attributes
    ----------
    t_s
        Start of the exposure in seconds after lamp off.
    source
        Picture on the common scale as data URI.
    brightened_source
        Brightened picture as data URI.
    brightened
        Factor of brightening as text.
    has_saturation
        Whether parts are saturated; they are shown white, since their colour is not known.
    """

    t_s: float
    source: str
    brightened_source: str
    brightened: str
    has_saturation: bool


def sensor_of(frames: Sequence[FrameRecord]) -> Sensor | None:
    """Return the camera from the first frame that can be read; None if none can."""
    for frame in frames:
        view = _reduced(frame, MakeThumbnail(GLOW_WIDTH))
        if view is not None:
            make = view.make if view.make and view.make not in (view.model or "") else None
            return Sensor(" ".join(filter(None, (make, view.model))), view.width, view.height)
    return None


def sample_picture(frames: Sequence[FrameRecord], camera: CameraResponse | None) -> bytes | None:
    """Return a small picture of the sample as the content of a PNG file.

    Parameters
    ----------
    frames
        Frames that show the sample, the best first; the first one that can be read is shown, as
        bright as a screen can.
    camera
        Curves of the camera; None for raw colours.

    Returns
    -------
    bytes or None
        Picture of 120 pixels in width at most; None if no frame can be read.

    Examples
    --------
    >>> import labrig
    >>> from labrig.report import sample_picture
    >>> picture = sample_picture(labrig.read_run("runs/decay").frames("decay"), None)
    >>> picture[1:4]
    b'PNG'
    """
    screen = screen_for(camera)
    for frame in frames:
        if (view := _reduced(frame, MakeThumbnail(GLOW_WIDTH))) is None:
            continue
        matrix = screen.lamp_lit if frame.role == FrameRole.DAYLIGHT else screen.glow
        linear = into_gamut(_to_screen(view, view.rgb.astype(np.float64), matrix))
        level = max(float(np.quantile(linear.max(axis=-1), BRIGHT_QUANTILE)), 1e-9)
        shown = np.where(view.is_saturated[..., np.newaxis], 1.0, np.minimum(linear / level, 1.0))
        return png(srgb_bytes(small(shown.astype(np.float32), SAMPLE_WIDTH).astype(np.float64)))
    return None


def daylight_picture(
    frames: Sequence[FrameRecord], patches: Sequence[PatchReport], screen: Screen
) -> Daylight | None:
    """Return the frame of longest exposure that is not overexposed, with the patches marked.

    The result is None if no frame can be read.
    """
    frame = _well_exposed(frames)
    view = None if frame is None else _reduced(frame, MakeThumbnail(DAYLIGHT_WIDTH))
    if frame is None or view is None:
        return None
    linear = into_gamut(_to_screen(view, view.rgb.astype(np.float64), screen.lamp_lit))
    # How well it was exposed does not matter here: what is bright should look bright.
    linear *= DAYLIGHT_BRIGHT / max(float(np.quantile(linear.max(axis=-1), BRIGHT_QUANTILE)), 1e-9)
    height, width = linear.shape[:2]
    balance = "white balanced for a halogen lamp" if screen.known else "in raw colours"
    if view.is_grey:
        balance = "from a monochrome sensor"
    return Daylight(
        source=_data_uri(srgb_bytes(linear)),
        width=width,
        height=height,
        marks=_marks(patches, view, width, height),
        caption=f"Frame {frame.path.name}, {exposure_text(frame.exposure_s)}, {balance}.",
    )


def _well_exposed(frames: Sequence[FrameRecord]) -> FrameRecord | None:
    """Return the frame of longest exposure that is not overexposed; None if none can be read."""
    best = None
    for frame in sorted(frames, key=lambda frame: frame.exposure_s):
        saturated_fraction = _reduced(frame, SaturatedFraction())
        if saturated_fraction is None:
            continue
        if best is not None and saturated_fraction > CLIPPED_FRACTION:
            break
        best = frame
    return best


def glow_pictures(photographs: Sequence[GlowPhotograph], screen: Screen) -> tuple[GlowPicture, ...]:
    """Return photographs of one decay on a common scale of DN/s, and each brightened."""
    prepared = []
    views = _thumbnails([photograph.frame for photograph in photographs])
    for photograph, view in zip(photographs, views, strict=True):
        if view is not None:
            has_saturation = view.is_saturated[..., np.newaxis]
            exposure_factor = _exposure_factor(photograph.frame)
            picture = view.rgb.astype(np.float64) / exposure_factor
            linear = into_gamut(_to_screen(view, picture, screen.glow))
            prepared.append((photograph, linear, has_saturation))
    if not prepared:
        return ()
    levels = [float(np.quantile(linear.max(axis=-1), BRIGHT_QUANTILE)) for _, linear, _ in prepared]
    full_scale = max(*levels, 1e-9)
    pictures = []
    for (photograph, linear, has_saturation), level in zip(prepared, levels, strict=True):
        factor = float(f"{min(full_scale / max(level, 1e-9), MAX_BRIGHTENED):.1e}")
        pictures.append(
            GlowPicture(
                t_s=photograph.t_s,
                source=_data_uri(srgb_bytes(np.where(has_saturation, 1.0, linear / full_scale))),
                brightened_source=_data_uri(
                    srgb_bytes(np.where(has_saturation, 1.0, linear * factor / full_scale))
                ),
                brightened=rounded(factor, 2),
                has_saturation=bool(has_saturation.any()),
            )
        )
    return tuple(pictures)


def _thumbnails(frames: Sequence[FrameRecord]) -> list[Thumbnail | None]:
    """Return small pictures of the glow; None for a frame that cannot be read."""
    try:
        return [*reduce_frames(frames, MakeThumbnail(GLOW_WIDTH))]
    except LabrigError:
        return [_reduced(frame, MakeThumbnail(GLOW_WIDTH)) for frame in frames]


def _reduced(frame: FrameRecord, reduction: Reduction[Reduced]) -> Reduced | None:
    """Reduce a frame; None if it cannot be read, since a report must not fail for a picture."""
    try:
        return reduce_frames([frame], reduction)[0]
    except LabrigError:
        return None


def _exposure_factor(frame: FrameRecord) -> float:
    """Return the factor t · ISO / N² of a frame, to which its values are proportional."""
    return frame.exposure_s * frame.iso / (frame.f_number or 1.0) ** 2


def _to_screen(
    view: Thumbnail, picture: NDArray[np.float64], matrix: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return a picture in linear sRGB by a colour matrix; a grey one is returned unchanged."""
    return np.asarray(picture @ (np.eye(3) if view.is_grey else matrix).T)


def _data_uri(rgb: NDArray[np.uint8]) -> str:
    """Return a picture as data URI in JPEG format."""
    return "data:image/jpeg;base64," + base64.b64encode(jpeg(rgb)).decode("ascii")


def _marks(
    patches: Sequence[PatchReport], view: Thumbnail, width: int, height: int
) -> tuple[RegionMark, ...]:
    """Return the rectangles of the patches whose region is known."""
    marks = []
    across, down = width / view.width, height / view.height
    for number, patch in enumerate(patches, start=1):
        if patch.region is None:
            continue
        try:
            x, y, region_width, region_height = region_pixels(patch.region, view.width, view.height)
        except UsageError:
            continue  # photographs of another size than the measured frames
        rectangle = (x * across, y * down, region_width * across, region_height * down)
        marks.append(RegionMark(number, patch.name, *(round(value, 1) for value in rectangle)))
    return tuple(marks)
