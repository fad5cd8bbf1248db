"""The LEDs behind their relays or outputs, with faults of contacts and of LEDs."""

from collections.abc import Iterable, Sequence

from labrig.foundation.clock import VirtualClock

from .faults import Fault, OfLed, given
from .leds import Leds


class LedCircuit:
    """The bank of LEDs and the contacts that feed them.

    Nothing runs in the background: the states of contacts and LEDs are computed when they are asked
    for.

    Parameters
    ----------
    leds
        The LEDs, all dark.
    lit
        Relays that are closed when the room is opened.
    faults
        Faults of the room, of which `led_dark` and `led_stuck` are the circuit's.
    clock
        The room's clock.
    """

    def __init__(
        self,
        leds: Leds,
        lit: Iterable[int],
        faults: Sequence[Fault],
        clock: VirtualClock,
    ) -> None:
        self._clock = clock
        self._dark = given(fault.led_dark for fault in faults)
        self._stuck = given(fault.led_stuck for fault in faults)
        changes = {
            time_s for span in (*self._dark, *self._stuck) for time_s in (span.at, span.until)
        }
        self._changes_s = sorted(time_s for time_s in changes if time_s > 0)
        self._asked = set(lit)
        # Stuck before the room was opened: it was lit then, and has not let go.
        self._closed = {
            span.relay
            for span in self._stuck
            if span.relay is not None and span.at < 0 and span.is_on(0.0)
        }
        self._leds = leds
        self._settle(0.0)

    @property
    def leds(self) -> Leds:
        """The LEDs with their history up to now."""
        self._follow()
        return self._leds

    def ask(self, relay: int, on: bool) -> None:
        """Have a relay or an output switched now."""
        self._follow()
        (self._asked.add if on else self._asked.discard)(relay)
        self._settle(self._clock.now())

    def dim(self, relay: int, fraction: float) -> None:
        """Change the brightness of an LED now, as a fraction of its full light."""
        self._follow()
        self._leds = self._leds.dimmed(relay, fraction, self._clock.now())

    def _follow(self) -> None:
        while self._changes_s and self._changes_s[0] <= self._clock.now():
            self._settle(self._changes_s.pop(0))

    def _settle(self, time_s: float) -> None:
        stays = {relay for relay in self._closed if _has(self._stuck, relay, time_s)}
        self._closed = self._asked | stays
        for relay in (led.relay for led in self._leds.bank):
            lit = relay in self._closed and not _has(self._dark, relay, time_s)
            self._leds = self._leds.switched(relay, lit, time_s)


def _has(spans: Sequence[OfLed], relay: int, time_s: float) -> bool:
    return any(span.is_on(time_s) for span in spans if span.relay in (None, relay))
