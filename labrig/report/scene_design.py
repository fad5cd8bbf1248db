"""A design in a scene, in words, and in frames of the scene beside its glow over time."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labrig.design import RGB_TO_Y, SceneDesign, SpreadDesign
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import rounded
from labrig.optics import srgb_bytes
from labrig.report.design import (
    SHOWN_Y,
    describe_design,
    describe_energy,
    draw_curve,
    draw_patches,
    time_text,
)
from labrig.report.figure_style import INK, figure_style
from labrig.report.picture_file import require_picture, save_picture

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: Frames that are drawn, spread over the keys.
MOST_FRAMES = 6
#: Part of the pixels that may be brighter than white where no key says how bright a frame is.
UNCLIPPED_PER_CENT = 99.0


def describe_scene_design(found: SceneDesign) -> str:
    """Describe a design in a scene: parameters, keys, and how it looks where it is rendered.

    Parameters
    ----------
    found
        The design.

    Returns
    -------
    str
        Lines of text.

    Examples
    --------
    >>> from labrig.design import SceneWish, WishedKey, WishFile, solve_in_scene, to_wish
    >>> from labrig.report import describe_scene_design
    >>> scene = SceneWish(file="cornell-box", material="phosphorescent", width_px=16, paths=8)
    >>> key = WishedKey(at="1 s", colour=(0, 2e-3, 2e-3))
    >>> file = WishFile(scene=scene, pixels={"wall": (0.1, 0.5)}, albedo=0.5, keys=(key,))
    >>> text = describe_scene_design(solve_in_scene(to_wish(file, "mine")))
    >>> [line.split(":")[0] for line in text.splitlines() if "rendered" in line][0]
    'rendered, round 1'
    """
    return "\n".join([describe_design(found.design, found.wish.places), *_in_the_scene(found)])


def describe_spread(found: SpreadDesign) -> str:
    """Describe materials that are spread over a surface: each dot's, and how it looks rendered.

    Parameters
    ----------
    found
        The materials.

    Returns
    -------
    str
        Lines of text.

    Examples
    --------
    >>> from labrig.design import SceneWish, SpreadWish, WishedKey, WishFile, solve_spread, to_wish
    >>> from labrig.report import describe_spread
    >>> scene = SceneWish(
    ...     file="cornell-box", material="phosphorescent", width_px=16, paths=8, spread=SpreadWish()
    ... )
    >>> key = WishedKey(at="1 s", colour=(0, 2e-3, 2e-3))
    >>> file = WishFile(scene=scene, pixels={"wall": (0.1, 0.5)}, albedo=0.5, keys=(key,))
    >>> text = describe_spread(solve_spread(to_wish(file, "mine")))
    >>> [line.split(":")[0] for line in text.splitlines() if ":" in line]
    ['wall', 'spread', 'rendered']
    """
    return "\n".join(_of_dots(found))


def _of_dots(found: SpreadDesign) -> Iterator[str]:
    names = found.wish.places
    for place in sorted(set(found.wish.keys.place.tolist())):
        yield f"{names[place]}:"
        yield describe_design(found.of_places[place], names)
    yield from (f"! {note}" for note in found.notes)
    yield f"spread: ΔE2000 {_listed(found.delta_e2000)}"
    if found.rendered_rgb is not None:
        yield f"rendered: ΔE2000 {_listed(found.rendered_delta_e2000)}"


def _listed(residuals: FloatArray) -> str:
    return ", ".join(f"{each:.1f}" for each in residuals)


def draw_scene_design(found: SceneDesign | SpreadDesign, path: Path) -> None:
    """Draw frames of the scene at the keys' times, above the glow of each place over time.

    Parameters
    ----------
    found
        The design.
    path
        Path of the picture, which ends in `.png`, `.svg` or `.pdf`.

    Raises
    ------
    UsageError
        The file name is not that of a picture.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.design import SceneWish, WishedKey, WishFile, solve_in_scene, to_wish
    >>> from labrig.report import draw_scene_design
    >>> scene = SceneWish(file="cornell-box", material="phosphorescent", width_px=16, paths=8)
    >>> key = WishedKey(at="1 s", colour=(0, 2e-3, 2e-3))
    >>> file = WishFile(scene=scene, pixels={"wall": (0.1, 0.5)}, albedo=0.5, keys=(key,))
    >>> draw_scene_design(solve_in_scene(to_wish(file, "mine")), Path("scene.png"))
    """
    from matplotlib.figure import Figure

    require_picture(path)
    times = np.unique(found.wish.keys.time_s)
    times = times[np.linspace(0, len(times) - 1, min(len(times), MOST_FRAMES)).round().astype(int)]
    pictures = found.pictures(times.tolist())
    numbers = sorted(set(found.wish.keys.place.tolist()))
    height, width = pictures.shape[1:3]
    frame_inches = 7.5 / len(times) * height / width
    with figure_style():
        figure = Figure(figsize=(7.5, frame_inches + 0.4 + 3.2 * len(numbers)))
        figure.set_layout_engine("constrained")
        sizes = [frame_inches + 0.4, 3.2 * len(numbers)]
        parts: Any = figure.subfigures(2, 1, height_ratios=sizes)
        above, below = parts
        frames = np.atleast_1d(above.subplots(1, len(times)))
        for axes, t_s, picture in zip(frames, times, pictures, strict=True):
            _draw_frame(axes, found, float(t_s), picture)
        heights = [4, 1.2] * len(numbers)
        rows = below.subplots(2 * len(numbers), 1, height_ratios=heights)
        for row, number in enumerate(numbers):
            draw_curve(rows[2 * row], found.design_at(number), number, found.wish.places[number])
            draw_patches(rows[2 * row + 1], found.design_at(number), number, found.rendered_rgb)
        save_picture(figure, path)


def _in_the_scene(found: SceneDesign) -> Iterator[str]:
    if cost := describe_energy(found.wished, found.kept):
        yield cost
    for number, residuals in enumerate(found.rounds):
        kept = ", which is kept" if number == found.best and len(found.rounds) > 1 else ""
        yield f"rendered, round {number + 1}: ΔE2000 {_listed(residuals)}{kept}"


def _draw_frame(
    axes: "Axes", found: SceneDesign | SpreadDesign, t_s: float, picture: FloatArray
) -> None:
    """Draw a frame so bright that its brightest key is shown at half of a screen's white."""
    keys = found.wish.keys
    own = np.flatnonzero(keys.time_s == t_s)
    y = float((np.pi * keys.rgb(found.wish.bands)[own] @ RGB_TO_Y).max())
    if y <= 0:
        y = SHOWN_Y * float(np.percentile(picture @ RGB_TO_Y, UNCLIPPED_PER_CENT))
    axes.imshow(srgb_bytes(picture * (SHOWN_Y / y if y > 0 else 1.0)), interpolation="nearest")
    height, width = picture.shape[:2]
    pixels = found.wish.file.pixels or {}
    for key in own.tolist():
        across, down = pixels[found.wish.places[keys.place[key]]]
        x, y_px = across * width - 0.5, down * height - 0.5
        axes.plot(x, y_px, "o", markersize=6, markerfacecolor="none", markeredgecolor="white")
    axes.set(xticks=[], yticks=[])
    white = found.light.white_cd_per_m2 * (y / SHOWN_Y if y > 0 else 1.0)
    axes.set_title(
        f"{time_text(t_s)}; white is\n{rounded(white, 2)} cd/m²", fontsize="x-small", color=INK
    )
