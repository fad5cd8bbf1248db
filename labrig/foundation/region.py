"""A rectangle on the sensor, in pixels or in fractions of the frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError

from labrig.foundation.errors import UsageError

#: Limit above the width of any sensor, which excludes infinity.
MAX_PIXELS = 1_000_000
#: Excess over the frame of fractions that were rounded.
SLACK = 1e-3
#: Largest length of a text quoted in a message.
MAX_SHOWN = 80
#: Number of pixels below which the noise of a region cannot be told from its structure.
MIN_PIXELS = 100
_EXPECTED = "expected four numbers x, y, width, height, in pixels or all as fractions of the frame"
Corner = Annotated[float, Field(ge=0, le=MAX_PIXELS)]
Extent = Annotated[float, Field(gt=0, le=MAX_PIXELS)]


@dataclass(frozen=True)
class IsRegion:
    """Annotation by which a region is recognised among the keys of a protocol."""


def _four_numbers(region: Any) -> Any:
    is_list = isinstance(region, (list, tuple))
    if is_list and len(region) == 4 and all(map(_is_number, region)):
        return region
    received = _list_text(region) if is_list else "nothing" if region is None else f"'{region}'"
    raise ValueError(f"{_EXPECTED}, got {received[:MAX_SHOWN]}")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _whole_or_fractions(region: tuple[float, float, float, float]) -> tuple[float, ...]:
    if max(region) > 1 and any(value != int(value) for value in region):
        raise ValueError(
            "expected [x, y, width, height] in whole pixels, or all as fractions of the frame ≤ 1, "
            f"got {_text(region)}"
        )
    x, y, width, height = region
    if max(region) <= 1 and max(x + width, y + height) > 1 + SLACK:
        raise ValueError(
            f"expected a region inside of the frame, got {_text(region)}: fractions that end at "
            f"{x + width:g} of its width and {y + height:g} of its height"
        )
    return region


def _list_text(values: Sequence[Any]) -> str:
    return f"[{', '.join('nothing' if value is None else str(value) for value in values)}]"


def _text(region: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:g}' for value in region)}]"


#: `[x, y, width, height]`: whole pixels, or fractions of the frame when all four are ≤ 1.
Region = Annotated[
    tuple[Corner, Corner, Extent, Extent],
    IsRegion(),
    BeforeValidator(_four_numbers),
    AfterValidator(_whole_or_fractions),
]

#: Default position of the sample: the middle quarter of the frame.
CENTRE: Region = (0.25, 0.25, 0.5, 0.5)


#: Form of a region on the command line, in messages.
_FORM = (
    "expected x,y,width,height in whole pixels (or all as fractions of the frame), such as "
    "700,400,64,64"
)


def parse_region(text: str) -> Region:
    """Parse a region `x,y,width,height` from the command line.

    Raises
    ------
    UsageError
        The text is not four numbers of a valid region.
    """
    try:
        return TypeAdapter(Region).validate_python([float(part) for part in text.split(",")])
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        reason = problem["msg"].removeprefix("Value error, ")
        if problem["type"] == "value_error" and text.count(",") == 3:
            raise UsageError(f"'{text}': {reason}") from None
        raise UsageError(f"'{text}' is no region; {_FORM}") from None
    except ValueError:
        raise UsageError(f"'{text}' is no region; {_FORM}") from None


def region_pixels(region: Region, width: int, height: int) -> tuple[int, int, int, int]:
    """Return `(x, y, width, height)` in pixels of a `width` × `height` frame.

    Raises
    ------
    UsageError
        The region extends beyond the frame.
    """
    x, y, w, h = region
    if max(region) <= 1:
        x, y, w, h = x * width, y * height, w * width, h * height
    # Edges are rounded, not extents, so that neighbours share an edge and 1 is the frame's.
    right, low = round(x + w), round(y + h)
    # A cell of the colour filter is two pixels wide and high.
    left, top = min(round(x), right - 2), min(round(y), low - 2)
    if min(left, top) < 0 or right > width or low > height:
        raise UsageError(
            f"region {_text(region)} leaves the frame of {width} × {height} pixels; "
            "give x, y, width, height inside it"
        )
    return left, top, right - left, low - top
