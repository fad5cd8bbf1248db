"""Views of a sphere: its outline, its radiance, and the tests."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.frames import part_frames, part_region, require_calibrated_camera
from labrig.analyse.inputs import Part
from labrig.calibration import CAMERA_KIND
from labrig.fit.angular import NearLight, SphereImage, fit_shading
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import region_pixels
from labrig.optics import Flat, rho_squared
from labrig.protocols.angular_fluorescence.analysis.channels import (
    chosen_channels,
    led_response,
    mixed_limit,
    reflected_at_most,
    reflected_signal,
)
from labrig.protocols.angular_fluorescence.analysis.outline import Outline, find_outline
from labrig.protocols.angular_fluorescence.protocol import AngularFrames, Pose
from labrig.protocols.angular_fluorescence.result import SphereViews
from labrig.record import FrameRecord
from labrig.reduce import binned, read_raw, saturated_cells
from labrig.results import LEVEL

#: Blocks of cells across a sphere, of which each is one place.
BLOCKS_ACROSS = 40
#: Least mean light as a fraction of the sensor's range: below, no LED was lit.
LEAST_LIGHT = 1e-3
#: Directions of the light's sides in degrees from the right, downwards.
SIDES_DEG = {"right": 0.0, "below": 90.0, "left": 180.0, "above": 270.0}
#: Tangent of the field angle in the corners of a 50 mm lens on a full-format body: what an
#: uncalibrated lens may do to the light by cos⁴ of that angle is taken for one σ.
CORNER_TANGENT = 21.6 / 50.0
#: σ of each number of a circle that is given where the frames show none: of a person who reads it
#: from a picture, in pixels and as a fraction of the radius, whichever is more.
GIVEN_SIGMA_PX, GIVEN_SIGMA = 2.0, 0.005
#: Difference of a given circle from the outline in the frames, as a fraction of the radius, up to
#: which it is the same one.
SAME = 0.03
#: Differences of a given circle from the outline in the frames that are named: in σ and in pixels.
DIFFERENT_SIGMA, DIFFERENT_PX = 3.0, 1.0
#: Part of the radius by which the outline may leave the region unnamed.
CUT = 0.005


@dataclass(frozen=True, eq=False)
class View:
    """One view: light in cells of the region, and the frame's size.

    Attributes
    ----------
    light
        LED on less LED off, as a fraction of the sensor's range, shape (rows, columns, channels).
    corner
        x and y of the first cell's corner in pixels.
    cell
        Width of a cell in pixels.
    size
        Width and height of the frame in pixels.
    """

    pose: Pose
    channels: tuple[str, ...]
    light: FloatArray
    corner: tuple[int, int]
    cell: int
    size: tuple[int, int]


def sphere_views(part: Part) -> tuple[tuple[SphereViews, ...], list[str]]:
    """Return the views of each LED with their tests, and warnings.

    Raises
    ------
    DataError
        Frames are damaged, no sphere is found, or there are too few views under an LED.
    UsageError
        The channels cannot be chosen.
    """
    frames = part_frames(part, *AngularFrames)
    require_calibrated_camera(part.inputs[CAMERA_KIND], part.run, frames)
    views, warnings = [], []
    for pose in part.protocol.poses():
        own = [frame for frame in frames if frame.unit == pose.unit]
        view, warning = _view(part, pose, own)
        if view is None:
            warnings.append(f"{pose.unit}: {warning}; the other views are used")
        else:
            views.append(view)
    lit = {pose.led: pose.part for pose in part.protocol.poses()}
    tested = []
    for led, light_part in lit.items():
        under_led = [view for view in views if view.pose.led == led]
        sphere, lines = _tested(part, under_led, led, light_part)
        tested.append(sphere)
        warnings += lines
    return tuple(tested), warnings


def _view(part: Part, pose: Pose, frames: Sequence[FrameRecord]) -> tuple[View | None, str]:
    """Return a view, or None and why there is none."""
    on = [frame for frame in frames if frame.role == AngularFrames.VIEW]
    off = [frame for frame in frames if frame.role == AngularFrames.OFF]
    if not on or not off:
        return None, "missing (go on with labrig resume)"
    raw = read_raw(on[0].path)
    cell = max(raw.cfa_side, 2)
    region = part_region(part, part.protocol.region)
    x, y, wide, high = region_pixels(region, raw.width, raw.height)
    left, top = x // cell, y // cell
    window = slice(top, (y + high) // cell), slice(left, (x + wide) // cell)
    if any(saturated_cells(read_raw(frame.path))[window].any() for frame in on):
        return None, "it clips (lower camera.iso)"
    light = _mean(on, window) - _mean(off, window)
    if np.percentile(light.sum(axis=2), 99) < LEAST_LIGHT:
        return None, "dark: the LED did not light, or the sphere was not in the region"
    corner = left * cell, top * cell
    return View(pose, raw.channels, light, corner, cell, (raw.width, raw.height)), ""


def _mean(frames: Sequence[FrameRecord], window: tuple[slice, slice]) -> FloatArray:
    pictures = [binned(read_raw(frame.path))[window] for frame in frames]
    return np.asarray(np.mean(pictures, axis=0), dtype=np.float64)


def _tested(
    part: Part, views: Sequence[View], led: str, light_part: str
) -> tuple[SphereViews, list[str]]:
    if not views:
        raise DataError(f"{led}: no view is lit and complete; go on with labrig resume")
    channels = views[0].channels
    signal = np.mean([view.light.mean(axis=(0, 1)) for view in views], axis=0)[: len(channels)]
    response = led_response(part.rig, led, channels, part.overrides.camera)
    limits = reflected_at_most(signal, response)
    chosen = chosen_channels(part.protocol.channels, channels, light_part, limits, response)
    outlines, warnings = _outlines(part, views, chosen)
    circles = np.array([[outline.x, outline.y, outline.radius] for outline in outlines])
    mean = _mean_outline(outlines)
    images = [
        _image(part, view, circle, chosen, response if light_part == "re-radiated" else None, mean)
        for view, circle in zip(views, circles, strict=True)
    ]
    warnings += _cut_warnings(views[0], mean)
    level = LEVEL / (2 * len(part.protocol.leds))
    tested = SphereViews(
        led=led,
        part=light_part,
        channels=tuple(channels[number] for number in chosen),
        reflected_at_most=mixed_limit(signal, limits, chosen),
        is_lens_known=_flat(part) is not None,
        circles=circles,
        shading=fit_shading(images, _light(part), level),
    )
    return tested, warnings


def _light(part: Part) -> NearLight:
    light = part.protocol.light
    side, angle = np.radians(SIDES_DEG[light.side]), np.radians(light.angle)
    across, down = np.sin(angle) * np.cos(side), np.sin(angle) * np.sin(side)
    direction = float(across), float(down), float(np.cos(angle))
    return NearLight(direction, light.distance_radii)


def _outlines(
    part: Part, views: Sequence[View], chosen: Sequence[int]
) -> tuple[list[Outline], list[str]]:
    """Return the outline of the sphere in each view in pixels, and warnings.

    One that the protocol gives is refined by the frames where these show one that is about the
    same. If they show another one, the difference counts as its error.
    """
    given = part.protocol.circle
    if given is None:
        return [_found(part, view, chosen) for view in views], []
    width, height = views[0].size
    x, y, radius = given.centre[0] * width, given.centre[1] * height, given.radius * width
    try:
        found = [_found(part, view, chosen) for view in views]
    except DataError:
        variance = np.full(3, max(GIVEN_SIGMA_PX, GIVEN_SIGMA * radius) ** 2)
        return [Outline(x, y, radius, np.diag(variance))] * len(views), []
    seen = _mean_outline(found)
    away = np.array([x - seen.x, y - seen.y, radius - seen.radius])
    is_same = bool((np.abs(away) <= max(GIVEN_SIGMA_PX, SAME * radius)).all())
    warnings = []
    if (np.abs(away) > np.maximum(DIFFERENT_SIGMA * seen.sigma, DIFFERENT_PX)).any():
        taken = "that of the frames is taken" if is_same else "the difference is in σ"
        warnings.append(
            f"circle: expected about the outline that the frames show, centre ({seen.x:.1f}, "
            f"{seen.y:.1f}) and radius {seen.radius:.1f} px, got centre ({x:.1f}, {y:.1f}) and "
            f"radius {radius:.1f} px; {taken}: correct it, or leave circle out"
        )
    if is_same:
        return found, warnings
    covariance = seen.covariance + np.diag(away**2)
    return [Outline(x, y, radius, covariance)] * len(views), warnings


def _found(part: Part, view: View, chosen: Sequence[int]) -> Outline:
    side_deg = SIDES_DEG[part.protocol.light.side]
    outline = find_outline(view.light[..., chosen].sum(axis=2), side_deg)
    return outline.scaled(view.cell, *view.corner)


def _mean_outline(outlines: Sequence[Outline]) -> Outline:
    """Return the mean outline of all views with the covariance of one of them.

    What the region cuts off is the same in all views, and so is the error that comes of it.
    """
    x, y, radius = np.mean([[each.x, each.y, each.radius] for each in outlines], axis=0)
    return Outline(x, y, radius, np.mean([each.covariance for each in outlines], axis=0))


def _cut_warnings(view: View, outline: Outline) -> list[str]:
    """Return a line if the region or the frame cuts the outline, by how much on each side."""
    left, top = view.corner
    high, wide = (count * view.cell for count in view.light.shape[:2])
    beyond = {
        "left": left - (outline.x - outline.radius),
        "right": outline.x + outline.radius - (left + wide),
        "above": top - (outline.y - outline.radius),
        "below": outline.y + outline.radius - (top + high),
    }
    cut = {side: px for side, px in beyond.items() if px > max(1.0, CUT * outline.radius)}
    if not cut:
        return []
    sides = ", ".join(
        f"{side} by {px:.0f} px ({px / outline.radius:.0%} of its radius)"
        for side, px in cut.items()
    )
    return [
        f"region: expected the whole sphere in it, got its outline cut: {sides}; the outline rests "
        "on what is left of it, and its error is in σ: enlarge the region"
    ]


def _image(
    part: Part,
    view: View,
    circle: FloatArray,
    chosen: Sequence[int],
    response: FloatArray | None,
    outline: Outline,
) -> SphereImage:
    """Return the places of the sphere, each the mean of a block of cells.

    The reflected light is subtracted as far as `response` tells it.
    """
    light = view.light
    block = max(1, int(2 * circle[2] / view.cell / BLOCKS_ACROSS))
    rows, columns = light.shape[0] // block, light.shape[1] // block
    cut = light[: rows * block, : columns * block].reshape(rows, block, columns, block, -1)
    values = cut.mean(axis=(1, 3))
    reflected, reflected_sigma = reflected_signal(values, response, chosen)
    radiance = values[..., list(chosen)].sum(axis=-1) - reflected
    step = block * view.cell
    y, x = np.meshgrid(
        view.corner[1] + step * (np.arange(rows) + 0.5),
        view.corner[0] + step * (np.arange(columns) + 0.5),
        indexing="ij",
    )
    across, down = (x - circle[0]) / circle[2], (y - circle[1]) / circle[2]
    inside = across**2 + down**2 < 1
    across, down, radiance = across[inside], down[inside], radiance[inside]
    by_reflection = reflected_sigma[inside] / np.maximum(radiance, 1e-12)
    normal = np.column_stack([across, down, np.sqrt(1 - across**2 - down**2)])
    flat, by_lens = _lens(part, rho_squared(x[inside], y[inside], *view.size), chosen)
    covariance = outline.covariance / outline.radius**2
    return SphereImage(normal, radiance / flat, np.stack([by_lens, by_reflection]), covariance)


def _flat(part: Part) -> Flat | None:
    """Return the calibrated flat field of the lens; None if there is none."""
    camera = part.inputs[CAMERA_KIND]
    return None if camera is None else camera.flat_at(part.protocol.camera.f_number)


def _lens(part: Part, rho2: FloatArray, chosen: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return the lens's known fall-off at some places, and the relative error by an unknown one."""
    flat = _flat(part)
    if flat is None:
        return np.ones_like(rho2), 1 - (1 + CORNER_TANGENT**2 * rho2) ** -2
    return np.asarray(flat.at(rho2)[:, chosen].mean(axis=1)), flat.sigma * rho2
