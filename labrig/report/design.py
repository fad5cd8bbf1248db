"""A design, also in a scene: in words, and in pictures of what was wanted and what is possible."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from labrig.design import RGB_TO_Y, Design, NearestMaterial, SceneDesign, SpreadDesign
from labrig.foundation.arrays import FloatArray
from labrig.foundation.number_format import aligned, power_of_ten, rounded
from labrig.foundation.quantity import duration_text
from labrig.optics import srgb_bytes
from labrig.report.colours import css_colour, into_gamut
from labrig.report.figure_files import require_picture, save_picture
from labrig.report.figure_style import INK, MUTED, figure_style
from labrig.results import with_uncertainty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: Lines of keys, conflicts and wishes that are written one by one.
MAX_LINES = 20
#: ΔE2000 from which a difference is seen.
SEEN = 1.0
#: Part of a glow whose loss is told.
SEEN_FACTOR = 0.01
#: Luminance of a screen's white with which a wanted patch is shown, its faintness taken away.
SHOWN_Y = 0.5
#: Times at which a curve is drawn.
POINTS = 600
#: Light over the strongest from which a time is drawn as lit: the glow of a scene is darkness.
LIT = 0.01
#: Part of the time beyond the last key that is drawn.
AFTER = 0.1


def describe_design(
    design: Design,
    places: Sequence[str],
    nearest: Sequence[NearestMaterial] = (),
) -> str:
    """Describe a design: parameters, keys, and what is not possible.

    Parameters
    ----------
    design
        The design.
    places
        Names of the places.
    nearest
        Measured materials that come near.

    Returns
    -------
    str
        Lines of text.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, solve, three_bands
    >>> from labrig.report import describe_design
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    >>> text = describe_design(solve(light, keys, three_bands(), albedo=0.5), ["patch"])
    >>> text.splitlines()[0]
    'k_r            0.1212(11) s⁻¹'
    """
    return "\n".join(
        [
            *_parameters(design),
            *_keys(design, places),
            *_conflicts(design),
            *_impossible(design),
            *(describe_nearest(found) for found in nearest),
        ]
    )


def describe_energy(wished: Design, kept: Design) -> str | None:
    """Say what it costs that a material emits no more light than it absorbs.

    Parameters
    ----------
    wished
        Design that need not keep the energy.
    kept
        The nearest that does.

    Returns
    -------
    str or None
        A line of text; None if the keys are met as well.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, solve, three_bands
    >>> from labrig.report import describe_energy
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 90.0], [[0.01, 0.2, 0.02], [0.005, 0.1, 0.01]])
    >>> kept = solve(light, keys, three_bands(), energy="kept")
    >>> describe_energy(solve(light, keys, three_bands()), kept)[:48]
    '! no more light can be emitted than is absorbed:'
    """
    before, after = float(wished.delta_e2000.max()), float(kept.delta_e2000.max())
    if after < before + SEEN:
        return None
    return (
        f"! no more light can be emitted than is absorbed: ΔE2000 is {after:.1f} at most, and "
        f"would be {before:.1f} otherwise; fainter keys, or more light before them, can be met"
    )


def describe_factor(factor: float) -> str | None:
    """Say that a written material glows less than its design.

    Parameters
    ----------
    factor
        Factor of Λ, as `labrig.design.written_factor` returns it.

    Returns
    -------
    str or None
        A sentence; None if it does not.

    Examples
    --------
    >>> from labrig.report import describe_factor
    >>> describe_factor(1.0)
    >>> describe_factor(0.92)[-41:]
    'the written material glows 0.92 as bright'
    """
    if factor > 1 - SEEN_FACTOR:
        return None
    return (
        "at single wavelengths more light would be emitted than is absorbed: the written material "
        f"glows {factor:.2g} as bright"
    )


def describe_nearest(found: NearestMaterial) -> str:
    """Say which measured material comes near, and how near.

    Parameters
    ----------
    found
        A measured material, or two in small areas side by side.

    Returns
    -------
    str
        One line.

    Examples
    --------
    >>> from labrig.design import Keys, LightProgramme, nearest_materials, solve, three_bands
    >>> from labrig.report import describe_nearest
    >>> light = LightProgramme.checked([0.0, 60.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [61.0, 90.0], [[0.0, 0.003, 0.010], [0.0, 0.0012, 0.004]])
    >>> one, two = nearest_materials(solve(light, keys, three_bands(), albedo=0.5))
    >>> describe_nearest(one)[:28]
    'nearest measured: blue-paint'
    """
    parts = " and ".join(
        f"{name} on {100 * part:.0f} % of the area" if len(found.names) > 1 else name
        for name, part in zip(found.names, found.fractions, strict=True)
    )
    return (
        f"nearest measured: {parts}, ΔE2000 {found.delta_e2000.mean():.1f} in the mean, "
        f"{found.delta_e2000.max():.1f} at most"
    )


def draw_design(design: Design, places: Sequence[str], path: Path) -> None:
    """Draw the luminance over time with the keys, and patches of what was wanted and what is got.

    Parameters
    ----------
    design
        The design.
    places
        Names of the places.
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
    >>> from labrig.design import Keys, LightProgramme, solve, three_bands
    >>> from labrig.report import draw_design
    >>> light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    >>> keys = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    >>> draw_design(solve(light, keys, three_bands(), albedo=0.5), ["patch"], Path("glow.svg"))
    """
    require_picture(path)
    with figure_style():
        save_picture(design_figure(design, places), path)


def design_figure(design: Design, places: Sequence[str]) -> "Figure":
    """Return the figure of `draw_design`, within `figure_style`."""
    from matplotlib.figure import Figure

    numbers = sorted(set(design.keys.place.tolist()))
    figure = Figure(figsize=(7.5, 3.2 * len(numbers)), layout="constrained")
    rows = figure.subplots(2 * len(numbers), 1, height_ratios=[4, 1.2] * len(numbers))
    for row, number in enumerate(numbers):
        draw_curve(rows[2 * row], design, number, places[number])
        draw_patches(rows[2 * row + 1], design, number)
    return figure


def time_text(t_s: float) -> str:
    """Return a time of a clock, which may be before its zero, such as `−5 s`."""
    return f"−{duration_text(-t_s)}" if t_s < 0 else duration_text(t_s)


def _parameters(design: Design) -> Iterator[str]:
    width = max((len(each.name) for each in design.estimates), default=0)
    units = {"1/s": " s⁻¹", "s/sr": " s sr⁻¹", "": ""}
    for each in design.estimates:
        if each.is_determined:
            value = with_uncertainty(each.value, each.sigma)
        else:
            value = f"{rounded(each.value, 3)}, undetermined"
        unit = units[each.unit] if each.is_determined else ""
        yield f"{each.name:{width}}  {value}{unit}"


def _keys(design: Design, places: Sequence[str]) -> Iterator[str]:
    """Yield a line for each key, in units in which a white card under a light of 1 is 1, 1, 1."""
    keys = design.keys
    wanted, got = np.pi * keys.rgb(design.bands), np.pi * design.got_rgb
    has_places = len(places) > 1
    # One power of ten for all: a line fits a terminal, and its numbers compare at a glance.
    most = float(max(wanted.max(initial=0.0), got.max(initial=0.0)))
    exponent = math.floor(math.log10(most)) if most > 0 else 0
    unit = f" / {power_of_ten(exponent)}" if exponent else ""
    wanted, got = wanted / 10.0**exponent, got / 10.0**exponent
    place = ["place"] if has_places else []
    rows = [["key", "at", *place, f"wanted R, G, B{unit}", f"got{unit}", "ΔE2000"]]
    for key in range(min(keys.count, MAX_LINES)):
        where = [places[keys.place[key]]] if has_places else []
        colours = (_numbers(wanted[key]), _numbers(got[key]))
        at = time_text(float(keys.time_s[key]))
        rows.append([f"{key + 1}", at, *where, *colours, f"{design.delta_e2000[key]:.1f}"])
    yield from aligned(rows)
    if keys.count > MAX_LINES:
        worst = int(design.delta_e2000.argmax())
        yield (
            f"{keys.count - MAX_LINES} more; the largest difference of all is "
            f"{design.delta_e2000[worst]:.1f} of key {worst + 1}"
        )


def _conflicts(design: Design) -> Iterator[str]:
    for conflict in design.visible_conflicts:
        yield (
            f"key {conflict.key + 1} works against key {conflict.other + 1}: without it "
            f"{100 * conflict.part:.0f} % of the other's squared residual would go"
        )


def _impossible(design: Design) -> Iterator[str]:
    for wish in design.impossible[:MAX_LINES]:
        yield f"! {wish}"
    if len(design.impossible) > MAX_LINES:
        yield f"! {len(design.impossible) - MAX_LINES} more wishes are not possible"


def draw_curve(axes: "Axes", design: Design, number: int, name: str) -> None:
    """Draw the luminance of one place over time, with the keys and the time of light."""
    programme, keys = design.programme, design.keys
    own = keys.place == number
    begin = float(programme.begin_s[0])
    end = float(keys.time_s[own].max())
    end += AFTER * max(end - begin, 1.0)
    times = np.linspace(begin, end, POINTS)
    axes.plot(times, np.pi * design.rgb_at(number, times) @ RGB_TO_Y, color=INK, linewidth=1.2)
    wanted = np.pi * keys.rgb(design.bands)[own]
    colours = [_shown(rgb, rgb) for rgb in wanted]
    axes.scatter(
        keys.time_s[own], wanted @ RGB_TO_Y, c=colours, s=36, edgecolors=INK, linewidths=0.8,
        zorder=3,
    )  # fmt: skip
    ends = np.append(programme.begin_s[1:], end)
    light = programme.irradiance[number].sum(axis=1)
    is_lit = light > LIT * light.max(initial=0.0)
    for first, last in zip(programme.begin_s[is_lit], ends[is_lit], strict=True):
        axes.axvspan(first, min(last, end), color=MUTED, alpha=0.15, linewidth=0)
    axes.set(xlabel="time / s", ylabel="luminance over a white's", xlim=(begin, end))
    if (wanted @ RGB_TO_Y > 0).any():
        axes.set_yscale("log")
    axes.set_title(name, fontsize="medium", color=INK)


def draw_patches(
    axes: "Axes", design: Design, number: int, got_rgb: FloatArray | None = None
) -> None:
    """Draw what was wanted above what is got, both brightened so that the first is bright.

    What is got may be that of a rendering instead of the design's, shape (keys, 3).
    """
    own = np.flatnonzero(design.keys.place == number)
    own = own[np.argsort(design.keys.time_s[own])][:MAX_LINES]
    wanted = design.keys.rgb(design.bands)[own]
    got = (design.got_rgb if got_rgb is None else got_rgb)[own]
    for column, (first, second) in enumerate(zip(wanted, got, strict=True)):
        for row, rgb in ((0.5, first), (0.0, second)):
            axes.add_patch(_patch(column, row, _shown(rgb, first)))
        time = time_text(float(design.keys.time_s[own[column]]))
        axes.text(column + 0.5, -0.1, time, ha="center", va="top", fontsize="x-small", color=INK)
    axes.set(xlim=(0, len(own)), ylim=(0, 1), yticks=[0.25, 0.75], xticks=[])
    axes.set_yticklabels(["got", "wanted"], fontsize="small")
    for spine in axes.spines.values():
        spine.set_visible(False)


def _patch(column: int, row: float, colour: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((column + 0.05, row + 0.02), 0.9, 0.46, color=colour, linewidth=0)


def _shown(rgb: FloatArray, wanted: FloatArray) -> str:
    """Return the colour of a patch with the brightness that shows the wanted one at half."""
    y = float(wanted @ RGB_TO_Y)
    return css_colour(into_gamut(rgb * (SHOWN_Y / y if y > 0 else 0.0)))


def _numbers(values: FloatArray) -> str:
    return ", ".join(rounded(value, 3) for value in values.tolist())


#: Frames that are drawn, spread over the keys.
MAX_FRAMES = 6
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
    times = times[np.linspace(0, len(times) - 1, min(len(times), MAX_FRAMES)).round().astype(int)]
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
