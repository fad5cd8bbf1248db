"""Outline of a sphere that is lit from one side."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, optimize

from labrig.foundation.arrays import BoolArray, FloatArray
from labrig.foundation.errors import DataError

#: Standard deviation in cells of the blur with which a first outline is looked for.
_BLUR = 1.0
#: Blur in cells of an edge by the cells themselves and the interpolation between them; the lens
#: adds to it, up to this many times as much.
_CELL_BLUR, _MOST_BLUR = 0.5, 6.0
#: Fraction of the brightest light above which a cell counts as lit.
_LIT = 0.25
#: Directions about the light's side in which the outline is looked for, in degrees.
_REACH_DEG = 65.0
_RAYS = 61
#: Least number of them in which it must be seen, and number of sectors of the jackknife.
_LEAST_RAYS, _SECTORS = 20, 6
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
    if rays < _LEAST_RAYS:
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
        bounds=([-np.inf, -np.inf, 0.0, 1.0], [np.inf, np.inf, np.inf, _MOST_BLUR]),
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
