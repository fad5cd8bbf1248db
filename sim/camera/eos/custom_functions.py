"""The custom functions of a 5D Mark II, as property 0xD1A0 reports them."""

import struct

from ..body_settings import BodySettings

#: Ids of custom functions.
_LONG_EXPOSURE_NOISE, _HIGHLIGHT_PRIORITY, _MIRROR_LOCK_UP = 0x201, 0x203, 0x60F

#: All functions of a 5D Mark II, group by group, in its order; the last has five values.
_GROUPS = {
    1: (0x101, 0x102, 0x103, 0x104, 0x105, 0x108, 0x10F),
    2: (_LONG_EXPOSURE_NOISE, 0x202, _HIGHLIGHT_PRIORITY, 0x204, 0x205),
    3: (0x505, 0x506, 0x50F, 0x510, 0x50E, _MIRROR_LOCK_UP, 0x508, 0x507),
    4: (0x701, 0x702, 0x704, 0x706, 0x80B, 0x80F, 0x70B),
}
_SEVERAL_VALUES = {0x507: (0, 0xFF, 0, 0xFF, 0)}


def custom_function_blocks(settings: BodySettings) -> tuple[bytes, ...]:
    """Return the values of the property: a 5D Mark II reports every group by itself."""
    switched_on = {
        _LONG_EXPOSURE_NOISE: settings.long_exposure_noise_reduction,
        _HIGHLIGHT_PRIORITY: settings.highlight_tone_priority,
        _MIRROR_LOCK_UP: settings.mirror_lock_up,
    }
    return tuple(
        _block(
            group,
            {
                function: _SEVERAL_VALUES.get(function, (int(switched_on.get(function, False)),))
                for function in functions
            },
        )
        for group, functions in _GROUPS.items()
    )


def _block(group: int, functions: dict[int, tuple[int, ...]]) -> bytes:
    numbers = [
        number
        for function, values in functions.items()
        for number in (function, len(values), *values)
    ]
    group_bytes = 4 * (2 + len(numbers))
    return struct.pack(
        f"<{5 + len(numbers)}I", 12 + group_bytes, 1, group, group_bytes, len(functions), *numbers
    )
