"""The custom functions (C.Fn) of an EOS, property 0xD1A0: all of them in one block of numbers.

Layout, in u32: bytes of the block with this number; groups; per group its id (C.Fn I is 1), its
bytes without the id, functions; per function its id, values, the values. A 5D Mark II reports each
group in a block of its own, other models all in one; functions take the same ids in both.

Sources: libgphoto2 camlibs/ptp2/canon-eos-customfunc.txt, with dumps of real cameras; ids and
values as ExifTool's CanonCustom Functions2, which finds the same block in CR2 files.
"""

import struct
from enum import IntEnum

#: Longest block, more than any camera has sent (364 bytes, a 5DS).
MAX_BYTES = 4096


class CustomFunction(IntEnum):
    """Ids of the custom functions that matter here.

    High ISO noise reduction and Auto Lighting Optimizer change the camera's JPEGs only, never a RAW
    file.
    """

    iso_expansion = 0x103
    long_exposure_noise_reduction = 0x201
    highlight_tone_priority = 0x203
    mirror_lock_up = 0x60F


class CustomFunctions:
    """Custom functions that the camera has reported so far, group by group."""

    def __init__(self) -> None:
        self._values: dict[int, tuple[int, ...]] = {}
        self._is_unknown = False

    def take(self, block: bytes) -> None:
        """Take in one block; a block of another layout invalidates all values."""
        parsed = parse_custom_functions(block)
        if parsed is None:
            self._is_unknown = True
        else:
            self._values |= parsed

    def value(self, function: CustomFunction) -> int | None:
        """Return a function's only value; None if it was not reported in a known layout."""
        values = self._values.get(function, ())
        return values[0] if len(values) == 1 and not self._is_unknown else None


def parse_custom_functions(block: bytes) -> dict[int, tuple[int, ...]] | None:
    """Return the values by function id; None where any number does not fit the known layout."""
    if not 8 <= len(block) <= MAX_BYTES or len(block) % 4:
        return None
    numbers = struct.unpack(f"<{len(block) // 4}I", block)
    size, groups = numbers[:2]
    # events of some models are padded behind the block
    if size % 4 or not 8 <= size <= len(block) or any(numbers[size // 4 :]):
        return None
    remaining = numbers[2 : size // 4]
    values: dict[int, tuple[int, ...]] = {}
    for _ in range(groups):
        if len(remaining) < 3 or remaining[1] % 4 or not 2 <= remaining[1] // 4 < len(remaining):
            return None
        end = 1 + remaining[1] // 4
        functions = _functions(remaining[3:end], remaining[2])
        if functions is None:
            return None
        values |= functions
        remaining = remaining[end:]
    return None if remaining else values


def _functions(numbers: tuple[int, ...], count: int) -> dict[int, tuple[int, ...]] | None:
    values = {}
    for _ in range(count):
        if len(numbers) < 2 or len(numbers) < 2 + numbers[1]:
            return None
        end = 2 + numbers[1]
        values[numbers[0]] = numbers[2:end]
        numbers = numbers[end:]
    return None if numbers else values
