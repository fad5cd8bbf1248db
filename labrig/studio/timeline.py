"""Times at which a page shows a light programme: the same number of frames for every light.

Within a light they lie the denser the shorter it has been on, since a glow changes most right after
the light does: one second after five minutes of light can be reached as easily as one hour.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from labrig.design import Wish
from labrig.foundation.arrays import FloatArray

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
