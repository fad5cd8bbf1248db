"""What somebody has set on the simulated camera's body by hand, and how the camera reports it."""

import struct
from dataclasses import dataclass

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


@dataclass(frozen=True)
class BodySettings:
    """Dial, lens switch and menus; as a careful person sets them for photometry.

    Attributes
    ----------
    exposure_mode
        Where the dial stands: 3 is M.
    autofocus
        The switch on the lens.
    iso
        As the dial says it; None for automatic.
    auto_power_off_s
        Seconds without a word from the host after which the camera switches itself off; 0: never.
    long_exposure_noise_reduction, highlight_tone_priority, mirror_lock_up
        Custom functions; only reported, their effect is not simulated.
    """

    exposure_mode: int = 3
    autofocus: bool = False
    iso: int | None = 100
    auto_power_off_s: int = 0
    long_exposure_noise_reduction: bool = False
    highlight_tone_priority: bool = False
    mirror_lock_up: bool = False

    def custom_function_blocks(self) -> tuple[bytes, ...]:
        """The values of property 0xD1A0: a 5D Mark II reports every group by itself."""
        switched_on = {
            _LONG_EXPOSURE_NOISE: self.long_exposure_noise_reduction,
            _HIGHLIGHT_PRIORITY: self.highlight_tone_priority,
            _MIRROR_LOCK_UP: self.mirror_lock_up,
        }
        return tuple(
            _block(
                group,
                {
                    function: _SEVERAL_VALUES.get(
                        function, (int(switched_on.get(function, False)),)
                    )
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
