"""Wishes that no phosphorescent material can meet, each with the nearest that is possible."""

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from labrig.design.bands import RGB_TO_Y, XYZ_OF_RGB, smooth_spectrum
from labrig.design.light import LightProgramme
from labrig.design.result import Design, Impossible
from labrig.foundation.arrays import FloatArray

#: Relative excess that counts as rounding of the keys.
ROUNDED = 1e-3
#: Relative error of a colour above which no light of the bands has it.
OUT_OF_GAMUT = 0.01


def impossible_keys(design: Design) -> tuple[Impossible, ...]:
    """Return the wishes of a design that cannot be met."""
    return (
        *_negative(design),
        *_out_of_gamut(design),
        *_before_light(design),
        *_brighter_in_the_dark(design),
        *_too_much(design),
    )


def _negative(design: Design) -> Iterator[Impossible]:
    """Yield keys with negative light; a colour of spectral bands may have negative channels."""
    if design.keys.is_colour(design.bands):
        return
    names = design.bands.names
    for key, wanted in enumerate(design.keys.radiance):
        band = int(wanted.argmin())
        if wanted[band] < -ROUNDED * float(np.abs(wanted).max()):
            yield Impossible(
                (key,),
                f"{_named(design, key)} is outside of the gamut of {len(names)} bands, with "
                f"{wanted[band] * np.pi:.3g} in {names[band]}",
                f"{_numbers(np.maximum(wanted, 0) * np.pi)}",
            )


def _out_of_gamut(design: Design) -> Iterator[Impossible]:
    if not design.keys.is_colour(design.bands):
        return
    for key, wanted in enumerate(design.keys.radiance):
        scale = float(np.abs(wanted).max())
        nearest = design.bands.to_rgb @ smooth_spectrum(wanted, design.bands.to_rgb)
        if float(np.abs(nearest - wanted).max()) > OUT_OF_GAMUT * scale:
            yield Impossible(
                (key,),
                f"{_named(design, key)} has the colour {_numbers(wanted * np.pi)}, which no light "
                "of these bands has",
                _numbers(nearest * np.pi),
            )


def _before_light(design: Design) -> Iterator[Impossible]:
    keys, programme = design.keys, design.programme
    is_bright = keys.rgb(design.bands) @ RGB_TO_Y > 0
    for key in np.flatnonzero(is_bright).tolist():
        light = programme.irradiance[keys.place[key]]
        begun = light[programme.begin_s <= keys.time_s[key]]
        if not begun.any():
            yield Impossible(
                (key,), f"{_named(design, key)} glows before any light has fallen there", "black"
            )


def _brighter_in_the_dark(design: Design) -> Iterator[Impossible]:
    """Yield pairs of neighbouring keys of which the later is brighter, with darkness between."""
    keys = design.keys
    # Sums of what only fades: bands, channels that are bands, or X, Y, Z of colours.
    fading, names = keys.radiance, design.bands.names
    if keys.is_colour(design.bands):
        fading, names = fading @ XYZ_OF_RGB.T, ("X", "Y", "Z")
    weight = 1 / keys.luminance(design.bands) ** 2
    order = np.lexsort((keys.time_s, keys.place)).tolist()
    for first, second in itertools.pairwise(order):
        if keys.place[first] != keys.place[second] or not _is_dark_between(
            design.programme, int(keys.place[first]), keys.time_s[[first, second]]
        ):
            continue
        excess = fading[second] - fading[first]
        if (excess > ROUNDED * float(fading[[first, second]].max())).any():
            pair = np.array([first, second])
            mean = weight[pair] @ keys.radiance[pair] / weight[pair].sum()
            both = np.where(
                keys.radiance[second] > keys.radiance[first], mean, keys.radiance[second]
            )
            yield Impossible(
                (first, second),
                f"{_named(design, second)} is brighter in {names[int(excess.argmax())]} than "
                f"{_named(design, first)} without light between, where a glow only fades",
                f"{_numbers(np.maximum(both, 0) * np.pi)} at both, or light between them",
            )


def _is_dark_between(programme: LightProgramme, place: int, ends_s: FloatArray) -> bool:
    last = np.append(programme.begin_s[1:], np.inf)
    overlaps = (programme.begin_s < ends_s[1]) & (last > ends_s[0])
    return not programme.irradiance[place][overlaps].any()


def _too_much(design: Design) -> Iterator[Impossible]:
    ratio = design.emitted_over_absorbed
    place = int(ratio.argmax())
    if 1 + ROUNDED < ratio[place] < np.inf:
        where = f" at place {place + 1}" if design.programme.n_places > 1 else ""
        yield Impossible(
            (),
            f"to glow like this, {ratio[place]:.3g} times as much light would have to leave the "
            f"material{where} as it absorbs (π∬L dλ dt over ∬(1 − albedo) E dλ dt)",
            f"Λ and the glow of all keys times {1 / ratio[place]:.3g}, or more light before them",
        )


def _named(design: Design, key: int) -> str:
    place = f" at place {design.keys.place[key] + 1}" if design.programme.n_places > 1 else ""
    return f"key {key + 1} ({design.keys.time_s[key]:g} s{place})"


def _numbers(values: FloatArray | Sequence[float]) -> str:
    return "[" + ", ".join(f"{value:.3g}" for value in values) + "]"
