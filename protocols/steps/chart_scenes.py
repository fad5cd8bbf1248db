"""A ColorChecker under the lamp of the relay, by itself and beside a grey card in its place."""

from dataclasses import dataclass

from labrig.acquire import Session

from .bracketing import SceneUnit

#: Names of the units of the card and of the chart, and of the card through a variable filter.
CARD_UNIT, CHART_UNIT, THROUGH_UNIT = "card", "chart", "card-through"
#: Reasons for the configurations, for the person.
WHY_CARD = "its light at every place tells how evenly the chart will be lit"
WHY_CHART = "its patches are known"
WHY_THROUGH = "it tells what filter and camera see at every wavelength"


@dataclass(frozen=True)
class ChartUnit(SceneUnit):
    """All of the chart, by itself."""

    def check(self, session: Session) -> None:
        """Check that the chart is found in the picture."""
        session.decide("colour chart", lambda: self._chart(session), when_planned="found")

    def _chart(self, session: Session) -> str:
        # Takes a while to load, and plans do without.
        from .chart_checks import chart_found

        return chart_found(self.own(session))
