"""When the frames of a sequence begin."""

from labrig.acquire import MOST_STEPS
from labrig.errors import ProtocolError
from labrig.quantity import duration_text


def frame_times_s(first_s: float, every_s: float, until_s: float) -> list[float]:
    """Begin of each frame, evenly from `first_s` to `until_s`, which is one of them if it fits.

    Raises
    ------
    ProtocolError
        More frames than a run may have steps.
    """
    count = (until_s - first_s) / every_s + 1e-9
    if count >= MOST_STEPS:
        raise ProtocolError(
            f"a frame every {duration_text(every_s)} until {duration_text(until_s)} makes "
            f"{count:.3g} frames, expected at most {MOST_STEPS}; take fewer"
        )
    return [first_s + number * every_s for number in range(int(count) + 1)]
