"""Requests of the page and their answers: wishes in the words of their file, designs as numbers.

Within a light the times of a timeline lie the denser the shorter it has been on, since a glow
changes most right after the light does: one second after five minutes of light can be reached as
easily as one hour.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from labrig.design import (
    RGB_TO_Y,
    Design,
    DesignBands,
    Estimate,
    Keys,
    Parameters,
    SpreadDesign,
    Wish,
    WishFile,
    visible_conflicts,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.models import FrozenModel, NotNegative, Positive, UnitFraction
from labrig.foundation.yaml_file import validate

#: Frames of a programme, and the least of one light in it.
FRAMES, LEAST = 200, 4
#: Time in s after a change of light up to which frames lie evenly.
EVEN_S = 0.5
#: Shown time after the last key and after the last change of light: a part of the time that has
#: passed since that change, and at least so many seconds.
AFTER, AT_LEAST_S = 0.3, 60.0


@dataclass(frozen=True, eq=False)
class Timeline:
    """Frames of a light programme.

    Attributes
    ----------
    frames_s
        Rising times in s, shape (n,).
    first
        First frame of each light, in the order of the programme's changes.
    """

    frames_s: FloatArray
    first: tuple[int, ...]


def timeline_of(wish: Wish) -> Timeline:
    """Return the frames of a wish's light programme, until some time after its last key."""
    begin = wish.programme.begin_s
    last_key = float(wish.keys.time_s.max(initial=begin[-1]))
    since = last_key - float(begin[-1])
    end = max(last_key + AFTER * since, float(begin[-1]) + AT_LEAST_S)
    edges = [*begin.tolist(), end]
    per_light = max(LEAST, FRAMES // len(begin))
    frames = [
        low + _delays(high - low, per_light, is_last=high == end)
        for low, high in itertools.pairwise(edges)
    ]
    first = tuple(number * per_light for number in range(len(begin)))
    return Timeline(np.concatenate(frames), first)


def _delays(duration_s: float, count: int, *, is_last: bool) -> FloatArray:
    """Return delays from 0 to a duration, without its end if another light follows."""
    part = np.arange(count) / (count - 1 if is_last else count)
    return np.asarray(EVEN_S * np.expm1(part * np.log1p(duration_s / EVEN_S)))


#: Name of the page in messages about what it sent.
SOURCE = "the page"
#: Most states and bands of a material that is set by hand.
MAX_STATES, MAX_BANDS = 2, 100
#: Digits of the numbers that are sent.
DIGITS = 5


class SetByHand(FrozenModel):
    """Parameters of a material that were set with the sliders.

    Attributes
    ----------
    k_r_per_s, k_e_per_s, reradiation, albedo, order
        As of `labrig.design.Parameters`.
    """

    k_r_per_s: Annotated[tuple[Positive, ...], Field(max_length=MAX_STATES)]
    k_e_per_s: Annotated[tuple[tuple[NotNegative, ...], ...], Field(max_length=MAX_STATES)]
    reradiation: Annotated[tuple[tuple[NotNegative, ...], ...], Field(max_length=MAX_STATES)]
    albedo: Annotated[tuple[UnitFraction, ...], Field(max_length=MAX_BANDS)]
    order: Positive = 1.0

    def parameters(self) -> Parameters:
        """Return the parameters, checked."""
        return Parameters.checked(
            self.k_r_per_s, self.k_e_per_s, self.reradiation, self.albedo, self.order
        )


class Asked(FrozenModel):
    """What the page asks about.

    Attributes
    ----------
    wish
        Content of a file of wishes.
    by_hand
        Parameters that were set by hand; None to solve for those that meet the wishes best.
    is_draft
        Whether the wish still changes: the energy is then not kept, which takes up to a second.
    """

    wish: dict[str, Any]
    by_hand: SetByHand | None = None
    is_draft: bool = False

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "Asked":
        """Return a checked message.

        Raises
        ------
        UsageError
            A key is missing, unknown or of the wrong kind.
        """
        return validate(content, cls, SOURCE)

    def file(self) -> WishFile:
        """Return the content of the file of wishes.

        Raises
        ------
        UsageError
            It is malformed.
        """
        return validate(self.wish, WishFile, SOURCE)


def wish_content(file: WishFile) -> dict[str, Any]:
    """Return a file of wishes as the page keeps it: its light by places, without empty keys."""
    content = file.model_dump(mode="json", exclude_none=True, exclude={"light"})
    if file.scene is not None:
        content.setdefault("pixels", {})
    if file.light is not None:
        light = file.model_dump(mode="json", exclude_none=True)["light"]
        content["places"] = dict.fromkeys(file.programmes, light)
    return content


def answer(design: Design, wish: Wish) -> dict[str, Any]:
    """Return a design as the page shows it, with colours of every place in all frames.

    A colour is linear R, G, B; 1, 1, 1 is a white card under D65 of strength 1.
    """
    n_places, times = len(wish.places), timeline_of(wish).frames_s
    places = np.repeat(np.arange(n_places), len(times))
    rgb = design.rgb_at(places, np.tile(times, n_places)).reshape(n_places, len(times), 3)
    return {
        **_over_time(wish, rgb),
        **_material(design),
        "keys": _judged(design),
        "impossible": [{"keys": wish.keys, "text": str(wish)} for wish in design.impossible],
        "conflicts": [[each.key, each.other] for each in design.visible_conflicts],
    }


def spread_answer(found: SpreadDesign) -> dict[str, Any]:
    """Return materials that are spread over a surface, as `answer`, with those of every place."""
    wish, keys = found.wish, found.wish.keys
    times = timeline_of(wish).frames_s
    rgb = np.array([found.rgb_at(place, times) for place in range(len(wish.places))])
    content = _over_time(wish, rgb) | _material(found.base)
    for place, design in zip(content["places"], found.of_places, strict=True):
        place["material"] = _material(design)
    impossible: list[dict[str, Any]] = [{"keys": [], "text": note} for note in found.notes]
    conflicts: list[list[int]] = []
    for design in {id(each): each for each in found.of_places if each is not found.base}.values():
        own = np.flatnonzero(np.isin(keys.place, design.keys.place)).tolist()
        impossible += [
            {"keys": [own[key] for key in each.keys], "text": str(each)}
            for each in design.impossible
        ]
        conflicts += [
            [own[each.key], own[each.other]]
            for each in visible_conflicts(design.conflicts, found.delta_e2000[own])
        ]
    return content | {
        "keys": _keys(keys, wish.bands, found.rgb, found.delta_e2000),
        "energy": None,
        "impossible": impossible,
        "conflicts": conflicts,
    }


def _over_time(wish: Wish, rgb_per_sr: FloatArray) -> dict[str, Any]:
    """Return the frames, and colours (places, frames, 3) of every place in them."""
    timeline = timeline_of(wish)
    places = np.repeat(np.arange(len(wish.places)), len(timeline.frames_s))
    times = np.tile(timeline.frames_s, len(wish.places))
    card = wish.programme.at(places, times) @ wish.bands.to_rgb.T
    rgb = np.pi * rgb_per_sr
    return {
        "frames_s": _numbers(timeline.frames_s),
        "first": timeline.first,
        "bands": wish.bands.names,
        "places": [
            {"name": name, "rgb": _numbers(own), "card": _numbers(lit)}
            for name, own, lit in zip(wish.places, rgb, card.reshape(rgb.shape), strict=True)
        ],
    }


def _material(design: Design) -> dict[str, Any]:
    return {
        "parameters": parameters_content(design),
        "open": [name for name, each in _estimates(design) if not each.is_determined],
        "sigma": {
            name: _number(each.sigma) for name, each in _estimates(design) if each.is_determined
        },
    }


def parameters_content(design: Design | Parameters) -> dict[str, Any]:
    """Return the parameters of a design as the page sends them back, see `SetByHand`."""
    return {
        "k_r_per_s": _numbers(design.k_r_per_s),
        "k_e_per_s": _numbers(design.k_e_per_s),
        "reradiation": _numbers(design.reradiation),
        "albedo": _numbers(design.albedo),
        "order": design.order,
    }


def _estimates(design: Design) -> list[tuple[str, Estimate]]:
    """Return the estimates by the names of single bands: those lit in proportion share one."""
    found = []
    for each in design.estimates:
        symbol, *rest = each.name.split(" ", 1)
        joined = rest[0] if rest else ""
        state, _, names = joined.partition(" ") if joined[:1].isdecimal() else ("", "", joined)
        own = [symbol, state] if state else [symbol]
        if symbol != "k_e" or (design.n_states > 1 and not names):
            found.append((each.name, each))
        elif " … " in names:
            first, last = (design.bands.names.index(name) for name in names.split(" … "))
            members = design.bands.names[first : last + 1]
            found += [(" ".join([*own, name]), each) for name in members]
        else:
            found += [(" ".join([*own, name]), each) for name in names.split(" + ")]
    return found


def _judged(design: Design) -> list[dict[str, Any]]:
    if not design.keys.count:
        return []
    return _keys(design.keys, design.bands, design.got_rgb, design.delta_e2000)


def _keys(
    keys: Keys, bands: DesignBands, got_rgb: FloatArray, delta_e2000: FloatArray
) -> list[dict[str, Any]]:
    wanted, got = np.pi * keys.rgb(bands), np.pi * got_rgb
    return [
        {
            "place": int(place),
            "at_s": float(time_s),
            "wanted": _numbers(first),
            "got": _numbers(second),
            "luminance": [_number(first @ RGB_TO_Y), _number(second @ RGB_TO_Y)],
            "delta_e": round(float(difference), 2),
        }
        for place, time_s, first, second, difference in zip(
            keys.place, keys.time_s, wanted, got, delta_e2000, strict=True
        )
    ]


def _number(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _numbers(values: FloatArray | Sequence[Any]) -> Any:
    array = np.asarray(values)
    if array.ndim:
        return [_numbers(each) for each in array]
    return float(f"{float(array):.{DIGITS}g}")
