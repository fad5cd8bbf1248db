"""Views of a sphere that is lit from one side: its outline, its radiance, and the tests."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage, optimize

from labrig.analyse.frames import part_frames, part_region, require_calibrated_camera
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CAMERA_KIND
from labrig.fit.angular import NearLight, SphereImage, fit_shading
from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import region_pixels
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning, Unmeasured
from labrig.optics import Flat, rho_squared
from labrig.protocols.angular_fluorescence.analysis.channels import (
    chosen_channels,
    led_response,
    mixed_limit,
    reflected_at_most,
    reflected_signal,
)
from labrig.protocols.angular_fluorescence.protocol import AngularFrames, Pose
from labrig.protocols.angular_fluorescence.result import SphereViews
from labrig.record import FrameRecord
from labrig.reduce import binned, read_raw, saturated_cells
from labrig.results import LEVEL

#: Standard deviation in cells of the blur with which a first outline is looked for.
_BLUR = 1.0
#: Blur in cells of an edge by the cells themselves and the interpolation between them; the lens
#: adds to it, up to this many times as much.
_CELL_BLUR, _MAX_BLUR = 0.5, 6.0
#: Fraction of the brightest light above which a cell counts as lit.
_LIT = 0.25
#: Directions about the light's side in which the outline is looked for, in degrees.
_REACH_DEG = 65.0
_RAYS = 61
#: Least number of them in which it must be seen, and number of sectors of the jackknife.
_MIN_RAYS, _SECTORS = 20, 6
#: Step along a ray in cells, and cells beyond the outline that must be in the picture.
_STEP, _MARGIN = 0.25, 3.0
#: Least part of the light that is lost there within these cells on both sides.
_FALL = 0.4
#: Range of the outline's fit, in radii.
_NEAR = (0.85, 1.08)
#: Largest scatter of the first outline about a circle, as a fraction of its radius.
_ROUND = 0.03


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline of a sphere, in cells of a picture or in pixels of a frame.

    Attributes
    ----------
    x, y, radius
        Its centre and radius.
    covariance
        Their covariance, shape (3, 3).
    """

    x: float
    y: float
    radius: float
    covariance: FloatArray

    @property
    def sigma(self) -> FloatArray:
        """Standard uncertainties of x, y and radius, shape (3,)."""
        return np.sqrt(np.diag(self.covariance))

    def scaled(self, cell: float, left: float, top: float) -> "Outline":
        """Return the outline in pixels, of cells of some width from a corner on."""
        x, y = left + cell * self.x, top + cell * self.y
        return Outline(x, y, cell * self.radius, cell**2 * self.covariance)


def find_outline(picture: FloatArray, side_deg: float) -> Outline:
    """Find the outline of a sphere on the side of the light.

    A first outline is where the light along rays from the middle of what is lit falls most steeply.
    Then the radial course of the light is fitted on both sides of it. Whatever the law of
    reflection, light near the rim is nearly a straight line over the cosine of the view, which
    rises as a square root from the rim inwards. Rays that leave the picture before the outline
    tell nothing of it. The covariance is that of fits without one sector of rays after the other
    (the jackknife), so that it holds what sectors disagree about.

    Parameters
    ----------
    picture
        Light of a part of the frame that contains the sphere, or most of it, shape
        (height, width).
    side_deg
        Direction from which the light comes, in degrees from the right, downwards.

    Returns
    -------
    Outline
        The outline in cells of the picture.

    Raises
    ------
    DataError
        There is no circle, or too little of it is in the picture.
    """
    turned = np.radians(side_deg + np.linspace(-_REACH_DEG, _REACH_DEG, _RAYS))
    first = _first(picture, turned)
    turned = turned[_is_whole(picture, turned, first)]
    _require_arc(len(turned))
    best = np.array(_fitted(picture, turned, first))
    sectors = np.array_split(np.arange(len(turned)), _SECTORS)
    without = np.array([_fitted(picture, np.delete(turned, own), tuple(best)) for own in sectors])
    away = without - without.mean(axis=0)
    covariance = (_SECTORS - 1) / _SECTORS * away.T @ away
    # The middle of a cell is half a cell from its edge.
    return Outline(best[0] + 0.5, best[1] + 0.5, best[2], covariance)


def _require_arc(rays: int) -> None:
    """Refuse an outline of which too little is in the picture."""
    if rays < _MIN_RAYS:
        raise DataError(
            f"expected the outline of the sphere in the region on the side of the light, got it in "
            f"{rays} of {_RAYS} directions: the region cuts it off; enlarge the region, or give "
            "circle: {centre: [x, y], radius: r} in the protocol"
        )


def _is_whole(
    picture: FloatArray, turned: FloatArray, circle: tuple[float, float, float]
) -> BoolArray:
    """Return which rays from a circle's centre end well beyond its rim within the picture."""
    x, y, radius = circle
    far = radius + _MARGIN
    return _is_inside(picture, x + far * np.cos(turned), y + far * np.sin(turned))


def _is_inside(picture: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    height, width = picture.shape
    return np.asarray((x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1))


def _first(picture: FloatArray, turned: FloatArray) -> tuple[float, float, float]:
    """Return the circle through the places of the steepest fall of the light."""
    smooth = ndimage.gaussian_filter(picture, _BLUR)
    bright = float(np.percentile(smooth, 99))
    if bright <= 0:
        raise DataError("expected a lit sphere in the region, got darkness")
    down, across = np.nonzero(smooth > _LIT * bright)
    start_x, start_y = across.mean(), down.mean()
    steps = np.arange(0.0, np.hypot(*picture.shape), _STEP)
    x = start_x + np.cos(turned)[:, np.newaxis] * steps
    y = start_y + np.sin(turned)[:, np.newaxis] * steps
    light = ndimage.map_coordinates(smooth, [y, x], order=1, mode="nearest")
    rays, steepest = np.arange(len(turned)), np.argmin(np.diff(light, axis=1), axis=1)
    reach = round(_MARGIN / _STEP)
    before, after = (
        light[rays, np.clip(steepest + turn * reach, 0, len(steps) - 1)] for turn in (-1, 1)
    )
    beyond = np.minimum(steepest + reach, len(steps) - 1)
    is_whole = _is_inside(picture, x[rays, beyond], y[rays, beyond])
    is_whole &= before - after > _FALL * before
    _require_arc(int(is_whole.sum()))
    x, y = x[rays, steepest][is_whole], y[rays, steepest][is_whole]
    used = np.ones(len(x), dtype=np.bool_)
    for _ in range(3):
        centre_x, centre_y, radius = _circle(x[used], y[used])
        off = np.hypot(x - centre_x, y - centre_y) - radius
        used = np.abs(off) <= max(3 * 1.4826 * float(np.median(np.abs(off))), 0.5)
    inside = 0 < centre_x < picture.shape[1] and 0 < centre_y < picture.shape[0]
    is_round = float(off[used].std()) < max(_ROUND * radius, 0.5)
    if not inside or used.sum() < len(x) / 2 or not is_round:
        raise DataError(
            "expected the outline of a sphere in the region, got none that is round; give its "
            "circle: {centre: [x, y], radius: r} in the protocol, or correct light.side"
        )
    return centre_x, centre_y, radius


def _circle(x: FloatArray, y: FloatArray) -> tuple[float, float, float]:
    """Return the circle through points with the least algebraic deviation."""
    middle_x, middle_y = x.mean(), y.mean()
    across, down = x - middle_x, y - middle_y
    terms = np.column_stack([across, down, np.ones_like(x)])
    solution, *_ = np.linalg.lstsq(terms, across**2 + down**2, rcond=None)
    half_x, half_y = solution[:2] / 2
    radius = float(np.sqrt(max(solution[2] + half_x**2 + half_y**2, 0.0)))
    return float(middle_x + half_x), float(middle_y + half_y), radius


def _fitted(
    picture: FloatArray, turned: FloatArray, first: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the circle whose rim explains the light on both sides of a first one."""
    start_x, start_y, start_radius = first
    count = max(round((_NEAR[1] - _NEAR[0]) * start_radius / 0.5), 12)
    distance = start_radius * np.linspace(*_NEAR, count)
    x = start_x + np.cos(turned)[:, np.newaxis] * distance
    y = start_y + np.sin(turned)[:, np.newaxis] * distance
    light = ndimage.map_coordinates(picture, [y, x], order=1, mode="nearest")
    scale = light.max(axis=1, keepdims=True)

    def residual(unknown: FloatArray) -> FloatArray:
        centre_x, centre_y, radius, blur = unknown
        inwards = radius - np.hypot(x - centre_x, y - centre_y)
        terms = _rim(inwards, float(radius), float(_CELL_BLUR * blur))
        normal = np.einsum("rsi,rsj->rij", terms, terms) + 1e-9 * np.eye(2)
        right = np.einsum("rsi,rs->ri", terms, light)
        part = np.linalg.solve(normal, right[..., np.newaxis])
        return np.asarray(((light - (terms @ part)[..., 0]) / scale).ravel())

    found = optimize.least_squares(
        residual,
        (*first, 1.5),
        bounds=([-np.inf, -np.inf, 0.0, 1.0], [np.inf, np.inf, np.inf, _MAX_BLUR]),
        diff_step=np.full(4, 1e-3),
        loss="soft_l1",
        f_scale=0.05,
    ).x
    return float(found[0]), float(found[1]), float(found[2])


def _rim(inwards: FloatArray, radius: float, blur: float) -> FloatArray:
    """Return a step at the rim and the cosine of the view, blurred, shape (…, 2).

    Parameters
    ----------
    inwards
        Distance from the rim towards the centre in cells, shape (…).
    radius
        Radius in cells.
    blur
        Standard deviation of the blur in cells.
    """
    step = 0.05
    least, largest = inwards.min() - 4 * blur, inwards.max() + 4 * blur
    # The same places whatever the circle, so that the fit sees a smooth function of it.
    depth = step * (np.arange(np.floor(least / step), np.ceil(largest / step) + 1) + 0.5)
    across = np.clip(1 - depth / radius, 0, None)
    cosine = np.where(depth > 0, np.sqrt(np.maximum(1 - across**2, 0.0)), 0.0)
    sharp = np.stack([np.where(depth > 0, 1.0, 0.0), cosine])
    blurred = ndimage.gaussian_filter1d(sharp, blur / step, axis=1, mode="nearest")
    return np.stack([np.interp(inwards, depth, row) for row in blurred], axis=-1)


#: Blocks of cells across a sphere, of which each is one place.
BLOCKS_ACROSS = 40
#: Least mean light as a fraction of the sensor's range: below, no LED was lit.
MIN_LIGHT = 1e-3
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


def sphere_views(context: AnalysisContext) -> tuple[tuple[SphereViews, ...], list[ResultWarning]]:
    """Return the views of each LED with their tests, and warnings.

    Raises
    ------
    DataError
        Frames are damaged, no sphere is found, or there are too few views under an LED.
    UsageError
        The channels cannot be chosen.
    """
    frames = part_frames(context, *AngularFrames)
    require_calibrated_camera(context.inputs[CAMERA_KIND], context.run, frames)
    views: list[View] = []
    warnings: list[ResultWarning] = []
    for pose in context.protocol.poses():
        own = [frame for frame in frames if frame.unit == pose.unit]
        view = _view(context, pose, own)
        if isinstance(view, ResultWarning):
            warnings.append(view.about(pose.unit))
        else:
            views.append(view)
    lit = {pose.led: pose.part for pose in context.protocol.poses()}
    tested = []
    for led, light_part in lit.items():
        under_led = [view for view in views if view.pose.led == led]
        sphere, of_led = _tested(context, under_led, led, light_part)
        tested.append(sphere)
        warnings += of_led
    return tuple(tested), warnings


def _view(
    context: AnalysisContext, pose: Pose, frames: Sequence[FrameRecord]
) -> View | ResultWarning:
    """Return a view, or a warning of why there is none."""
    on = [frame for frame in frames if frame.role == AngularFrames.VIEW]
    off = [frame for frame in frames if frame.role == AngularFrames.OFF]
    if not on or not off:
        return Unmeasured(
            "view-missing", "missing (go on with labrig resume); the other views are used"
        )
    raw = read_raw(on[0].path)
    cell = max(raw.cfa_side, 2)
    region = part_region(context, context.protocol.region)
    x, y, wide, high = region_pixels(region, raw.width, raw.height)
    left, top = x // cell, y // cell
    window = slice(top, (y + high) // cell), slice(left, (x + wide) // cell)
    if any(saturated_cells(read_raw(frame.path))[window].any() for frame in on):
        return Disturbance("view-clipped", "it clips (lower camera.iso); the other views are used")
    light = _mean(on, window) - _mean(off, window)
    if np.percentile(light.sum(axis=2), 99) < MIN_LIGHT:
        return Unmeasured(
            "view-dark",
            "dark: the LED did not light, or the sphere was not in the region; the other views are "
            "used",
        )
    corner = left * cell, top * cell
    return View(pose, raw.channels, light, corner, cell, (raw.width, raw.height))


def _mean(frames: Sequence[FrameRecord], window: tuple[slice, slice]) -> FloatArray:
    pictures = [binned(read_raw(frame.path))[window] for frame in frames]
    return np.asarray(np.mean(pictures, axis=0), dtype=np.float64)


def _tested(
    context: AnalysisContext, views: Sequence[View], led: str, light_part: str
) -> tuple[SphereViews, list[ResultWarning]]:
    if not views:
        raise DataError(f"{led}: no view is lit and complete; go on with labrig resume")
    channels = views[0].channels
    signal = np.mean([view.light.mean(axis=(0, 1)) for view in views], axis=0)[: len(channels)]
    response = led_response(context.rig, led, channels, context.overrides.camera)
    limits = reflected_at_most(signal, response)
    chosen = chosen_channels(context.protocol.channels, channels, light_part, limits, response)
    outlines, warnings = _outlines(context, views, chosen)
    circles = np.array([[outline.x, outline.y, outline.radius] for outline in outlines])
    mean = _mean_outline(outlines)
    images = [
        _image(
            context, view, circle, chosen, response if light_part == "re-radiated" else None, mean
        )
        for view, circle in zip(views, circles, strict=True)
    ]
    warnings += _cut_warnings(views[0], mean)
    level = LEVEL / (2 * len(context.protocol.leds))
    tested = SphereViews(
        led=led,
        part=light_part,
        channels=tuple(channels[number] for number in chosen),
        reflected_at_most=mixed_limit(signal, limits, chosen),
        is_lens_known=_flat(context) is not None,
        circles=circles,
        shading=fit_shading(images, _light(context), level),
    )
    return tested, warnings


def _light(context: AnalysisContext) -> NearLight:
    light = context.protocol.light
    side, angle = np.radians(SIDES_DEG[light.side]), np.radians(light.angle)
    across, down = np.sin(angle) * np.cos(side), np.sin(angle) * np.sin(side)
    direction = float(across), float(down), float(np.cos(angle))
    return NearLight(direction, light.distance_radii)


def _outlines(
    context: AnalysisContext, views: Sequence[View], chosen: Sequence[int]
) -> tuple[list[Outline], list[ResultWarning]]:
    """Return the outline of the sphere in each view in pixels, and warnings.

    One that the protocol gives is refined by the frames where these show one that is about the
    same. If they show another one, the difference counts as its error.
    """
    given = context.protocol.circle
    if given is None:
        return [_found(context, view, chosen) for view in views], []
    width, height = views[0].size
    x, y, radius = given.centre[0] * width, given.centre[1] * height, given.radius * width
    try:
        found = [_found(context, view, chosen) for view in views]
    except DataError:
        variance = np.full(3, max(GIVEN_SIGMA_PX, GIVEN_SIGMA * radius) ** 2)
        return [Outline(x, y, radius, np.diag(variance))] * len(views), []
    seen = _mean_outline(found)
    away = np.array([x - seen.x, y - seen.y, radius - seen.radius])
    is_same = bool((np.abs(away) <= max(GIVEN_SIGMA_PX, SAME * radius)).all())
    warnings: list[ResultWarning] = []
    if (np.abs(away) > np.maximum(DIFFERENT_SIGMA * seen.sigma, DIFFERENT_PX)).any():
        taken = "that of the frames is taken" if is_same else "the difference is in σ"
        warnings.append(
            Contradiction(
                "circle-differs",
                "expected about the outline that the frames show, centre ({seen_x_px:.1f}, "
                "{seen_y_px:.1f}) and radius {seen_radius_px:.1f} px, got centre ({x_px:.1f}, "
                "{y_px:.1f}) and radius {radius_px:.1f} px; {taken}: correct it, or leave circle "
                "out",
                subject="circle",
                seen_x_px=seen.x,
                seen_y_px=seen.y,
                seen_radius_px=seen.radius,
                x_px=x,
                y_px=y,
                radius_px=radius,
                taken=taken,
            )
        )
    if is_same:
        return found, warnings
    covariance = seen.covariance + np.diag(away**2)
    return [Outline(x, y, radius, covariance)] * len(views), warnings


def _found(context: AnalysisContext, view: View, chosen: Sequence[int]) -> Outline:
    side_deg = SIDES_DEG[context.protocol.light.side]
    outline = find_outline(view.light[..., chosen].sum(axis=2), side_deg)
    return outline.scaled(view.cell, *view.corner)


def _mean_outline(outlines: Sequence[Outline]) -> Outline:
    """Return the mean outline of all views with the covariance of one of them.

    What the region cuts off is the same in all views, and so is the error that comes of it.
    """
    x, y, radius = np.mean([[each.x, each.y, each.radius] for each in outlines], axis=0)
    return Outline(x, y, radius, np.mean([each.covariance for each in outlines], axis=0))


def _cut_warnings(view: View, outline: Outline) -> list[ResultWarning]:
    """Return a warning if the region or the frame cuts the outline, by how much on each side."""
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
    return [
        Disturbance(
            "outline-cut",
            "expected the whole sphere in it, got its outline cut: {sides}; the rest of the "
            "outline is used, and its error is in σ: enlarge the region",
            subject="region",
            sides=tuple(
                f"{side} by {px:.0f} px ({100 * px / outline.radius:.0f} % of its radius)"
                for side, px in cut.items()
            ),
        )
    ]


def _image(
    context: AnalysisContext,
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
    flat, by_lens = _lens(context, rho_squared(x[inside], y[inside], *view.size), chosen)
    covariance = outline.covariance / outline.radius**2
    return SphereImage(normal, radiance / flat, np.stack([by_lens, by_reflection]), covariance)


def _flat(context: AnalysisContext) -> Flat | None:
    """Return the calibrated flat field of the lens; None if there is none."""
    camera = context.inputs[CAMERA_KIND]
    return None if camera is None else camera.flat_at(context.protocol.camera.f_number)


def _lens(
    context: AnalysisContext, rho2: FloatArray, chosen: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return the lens's known fall-off at some places, and the relative error by an unknown one."""
    flat = _flat(context)
    if flat is None:
        return np.ones_like(rho2), 1 - (1 + CORNER_TANGENT**2 * rho2) ** -2
    return np.asarray(flat.at(rho2)[:, chosen].mean(axis=1)), flat.sigma * rho2
