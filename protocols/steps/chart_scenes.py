"""A ColorChecker under the lamp of the relay, by itself and beside a grey card; its checks."""

from collections.abc import Sequence
from dataclasses import dataclass

from labrig.acquire import Session
from labrig.record import FrameRecord
from labrig.reduce import find_colour_chart

from .bracketing import SceneUnit

#: Names of the units of the card and of the chart, and of the card through a variable filter.
CARD_UNIT, CHART_UNIT, THROUGH_UNIT = "card", "chart", "card-through"
#: Reasons for the configurations, for the person.
WHY_CARD = "its light at every place measures how evenly the chart will be lit"
WHY_CHART = "its patches are known"
WHY_THROUGH = "it measures the response of filter and camera at every wavelength"


@dataclass(frozen=True)
class ChartUnit(SceneUnit):
    """All of the chart, by itself."""

    def check(self, session: Session) -> None:
        """Check that the chart is found in the picture."""
        session.decide("colour chart", lambda: chart_found(self.own(session)), when_planned="found")


def chart_found(frames: Sequence[FrameRecord]) -> str:
    """Return where the chart is, in words.

    Raises
    ------
    DataError
        No chart is found, see `find_colour_chart`.
    """
    # The shortest exposure of a bracket is metered: nothing clips.
    metered = min(frames, key=lambda frame: frame.exposure_s)
    patches = find_colour_chart(metered.path)
    middles = [(x + wide / 2, y + high / 2) for x, y, wide, high in patches]
    x, y = (sum(values) / len(values) for values in zip(*middles, strict=True))
    return f"{len(patches)} patches about {100 * x:.0f} % across and {100 * y:.0f} % down the frame"
