"""A serial line read against deadlines on the injected clock.

pyserial's own time-outs count on the system's clock, so ports are opened non-blocking.
"""

import logging
from collections.abc import Callable

import serial

from labrig.acquire import PORT_FAILURES, SerialPort, gone
from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceLostError, UnclearAnswerError

#: Interval of polling; USB serial adapters deliver once a millisecond at best.
POLL_S = 0.002
#: Answers come at once; through a slow hub or into a busy PC some are a tenth of a second late.
#: Whoever wants to be sure that nothing is on its way any more waits for longer than that.
LATEST_ANSWER_S = 0.25
#: Time within which a line becomes quiet, if ever.
DRAIN_S = 1.0
#: Interval of polling while draining.
DRAIN_POLL_S = 0.01

_logger = logging.getLogger(__name__)


class SerialLine:
    """Writing and reading with time-outs and one-line errors.

    Parameters
    ----------
    port
        Open port whose reads do not block.
    clock
        Clock of the time-outs.
    name
        Name of the device in messages, for example `Numato board at COM3`.
    """

    def __init__(self, port: SerialPort, clock: Clock, name: str) -> None:
        self._port = port
        self._clock = clock
        self._name = name

    def write(self, data: bytes) -> None:
        """Send `data`.

        Raises
        ------
        UnclearAnswerError
            The device does not take it.
        DeviceLostError
            The device is gone.
        """
        _logger.debug("to %s: %r", self._name, data)
        try:
            self._port.write(data)
        except serial.SerialTimeoutException:
            raise UnclearAnswerError(
                f"{self._name} does not accept the bytes that are sent to it; check its power, "
                "cable and address"
            ) from None
        except PORT_FAILURES as error:
            raise self._lost_error(error) from None

    def read_until(self, end: bytes, timeout_s: float) -> bytes:
        """Return the bytes up to and including `end`.

        Raises
        ------
        UnclearAnswerError
            `end` did not come in time; the message shows the bytes that came.
        """
        return self._read(lambda received: received.endswith(end), f"{end!r} at the end", timeout_s)

    def read_exactly(self, count: int, timeout_s: float) -> bytes:
        """Return the next `count` bytes.

        Raises
        ------
        UnclearAnswerError
            They did not come in time; the message shows the bytes that came.
        """
        return self._read(lambda received: len(received) == count, f"{count} bytes", timeout_s)

    def discard(self) -> None:
        """Discard the bytes that have arrived, which belong to no command that is still to come."""
        while self._waiting():
            self._read_byte()

    def drain(self, quiet_s: float = LATEST_ANSWER_S, timeout_s: float = DRAIN_S) -> bytes:
        """Return all bytes that come until the line is quiet for `quiet_s`."""
        deadline_s = self._clock.now() + timeout_s
        quiet_since_s = self._clock.now()
        received = b""
        while self._clock.now() - quiet_since_s < quiet_s and self._clock.now() < deadline_s:
            if self._waiting():
                received += self._read_byte()
                quiet_since_s = self._clock.now()
            else:
                self._clock.sleep(DRAIN_POLL_S)
        if received:
            self._log(received)
        return received

    def read_burst(self, quiet_s: float) -> bytes:
        """Return one burst: begun within `LATEST_ANSWER_S`, ended by a pause of `quiet_s`."""
        deadline_s = self._clock.now() + LATEST_ANSWER_S
        while not self._waiting() and self._clock.now() < deadline_s:
            self._clock.sleep(POLL_S)
        return self.drain(quiet_s) if self._waiting() else b""

    def _read(self, is_all: Callable[[bytes], bool], expected: str, timeout_s: float) -> bytes:
        """Read bytes one by one, so that later ones stay in the port."""
        deadline_s = self._clock.now() + timeout_s
        received = b""
        while not is_all(received):
            byte = self._read_byte()
            received += byte
            if self._clock.now() >= deadline_s and not is_all(received):
                raise UnclearAnswerError(
                    f"{self._name} did not answer within {timeout_s:g} s: expected {expected}, "
                    f"got {received!r}; check its power, cable and address"
                )
            if not byte:
                self._clock.sleep(POLL_S)
        self._log(received)
        return received

    def _log(self, received: bytes) -> None:
        _logger.debug("from %s: %r", self._name, received)

    def _read_byte(self) -> bytes:
        try:
            return self._port.read(1) if self._port.in_waiting else b""
        except PORT_FAILURES as error:
            raise self._lost_error(error) from None

    def _waiting(self) -> bool:
        try:
            return self._port.in_waiting > 0
        except PORT_FAILURES as error:
            raise self._lost_error(error) from None

    def _lost_error(self, error: Exception) -> DeviceLostError:
        return DeviceLostError(f"{self._name} is gone {gone(error, self._name)}")
