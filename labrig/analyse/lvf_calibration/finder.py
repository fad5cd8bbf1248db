"""Finds the lit strip of a linear variable filter in a picture."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from labrig.analyse.lvf_calibration.picture import Image, Picture
from labrig.calibration.lvf_file import SLICES, Strip
from labrig.errors import DataError

#: Lit is what is brighter than so many times the noise of the dark surroundings,
SEEN_SIGMA = 6.0
#: than this share of the brightest light near by,
EDGE = 0.4
#: and than this share of the brightest of all: less is stray light.
FAINTEST = 3e-4
#: How near, as a share of the frame's width. Along the strip the light may double within it.
NEAR = 0.01
#: Regions read upright along a strip that is tilted more would be of too many wavelengths.
MOST_TILT_DEGREES = 5.0
#: A strip is so many times as long as it is high, and fills this share of the frame at the least.
LEAST_ELONGATION = 2.0
LEAST_SHARE = 0.005
#: How much of the rectangle is lit; more than all is rounding.
FULL = (0.9, 1.1)
#: Left out at each long side and at each end, as shares of the strip's height and length.
LONG_MARGIN, END_MARGIN = 0.12, 0.01
#: A slice is two pixels wide at the least: a cell of the colour filter.
_LEAST_SLICE = 2


@dataclass(frozen=True)
class FoundStrip:
    """A lit rectangle.

    Attributes
    ----------
    corners
        (x, y) in pixels, clockwise from the upper left.
    tilt_degrees
        Of its long side; > 0 falls to the right.
    length, height
        In pixels.
    width_of_frame, height_of_frame
        In pixels.
    """

    corners: tuple[tuple[float, float], ...]
    tilt_degrees: float
    length: float
    height: float
    width_of_frame: int
    height_of_frame: int

    def strip(self, rising: bool) -> Strip:
        """Its inner part in fractions of the frame."""
        upper_left, upper_right, lower_right, lower_left = np.array(self.corners)
        left, right = (upper_left + lower_left) / 2, (upper_right + lower_right) / 2
        inwards = END_MARGIN * (right - left)
        frame = np.array([self.width_of_frame, self.height_of_frame])
        return Strip(
            left=_point((left + inwards) / frame),
            right=_point((right - inwards) / frame),
            height=self.height * (1 - 2 * LONG_MARGIN) / self.height_of_frame,
            rising=rising,
        )


def find_strip(picture: Picture) -> FoundStrip:
    """The brightest elongated rectangle in an otherwise dark picture.

    Raises
    ------
    DataError
        There is none, it is tilted by more than 5°, or too short to be read.
    """
    light = picture.light()
    height, width = light.shape
    lit = _lit(light)
    if lit is None:
        raise DataError(
            "no strip is lit in the picture: the lamp is out, the filter is not in its place, or "
            "the frames are too short"
        )
    (middle_x, middle_y), across, down, angle = _rectangle(lit)
    if across * down < LEAST_SHARE * width * height or across < LEAST_ELONGATION * down:
        raise DataError(
            f"expected a long strip on a dark ground, found {across:.0f} x {down:.0f} pixels that "
            "are lit; keep other light away and the holder round the filter dark"
        )
    if abs(angle) > MOST_TILT_DEGREES:
        raise DataError(
            f"the strip is tilted by {angle:+.1f}° against the frame, at most "
            f"{MOST_TILT_DEGREES:g}° are allowed; turn the filter or the camera"
        )
    if across * (1 - 2 * END_MARGIN) < _LEAST_SLICE * SLICES:
        raise DataError(
            f"the strip is {across:.0f} pixels long, {_LEAST_SLICE * SLICES} or more are needed "
            f"for {SLICES} positions; move the camera nearer"
        )
    if not FULL[0] < np.count_nonzero(lit) / (across * down) < FULL[1]:
        raise DataError(
            "what is lit is no rectangle; keep other light away and the holder round the filter "
            "dark"
        )
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    aside = np.array([-along[1], along[0]])
    middle = np.array([middle_x, middle_y])
    corners = [
        _point(middle + x * across / 2 * along + y * down / 2 * aside)
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return FoundStrip(tuple(corners), float(angle), float(across), float(down), width, height)


def _lit(light: Image) -> NDArray[np.uint8] | None:
    """(height, width) 1 in the largest lit patch; None without light."""
    ground = float(np.median(light))
    noise = 1.4826 * float(np.median(np.abs(light - ground)))
    above = light - np.float32(ground)
    height, width = light.shape
    near = np.ones((height // 2 * 2 + 1, int(NEAR * width) // 2 * 2 + 1), np.uint8)
    local = cv2.dilate(above, near)
    least = max(SEEN_SIGMA * noise, FAINTEST * float(above.max()))
    lit = ((above > least) & (above > EDGE * local)).astype(np.uint8)
    cell = np.ones((3, 3), np.uint8)
    whole = cv2.morphologyEx(cv2.morphologyEx(lit, cv2.MORPH_OPEN, cell), cv2.MORPH_CLOSE, cell)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(whole)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(labels == largest, dtype=np.uint8)


def _rectangle(lit: NDArray[np.uint8]) -> tuple[tuple[float, float], float, float, float]:
    """Middle, length, height in pixels and tilt in degrees of the rectangle of equal moments.

    Moments are of all pixels: they tell a tilt of a fraction of a pixel, which corners do not.
    """
    m = cv2.moments(lit, binaryImage=True)
    middle = m["m10"] / m["m00"] + 0.5, m["m01"] / m["m00"] + 0.5
    xx, yy, xy = (m[name] / m["m00"] for name in ("mu20", "mu02", "mu11"))
    (short, long), axes = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    angle = math.degrees(math.atan2(axes[1, 1], axes[0, 1]))
    # n pixels side by side have the variance (n² − 1)/12.
    across, down = (math.sqrt(12 * variance + 1) for variance in (long, short))
    return middle, across, down, (angle + 90) % 180 - 90


def _point(xy: NDArray[np.float64]) -> tuple[float, float]:
    return float(xy[0]), float(xy[1])
