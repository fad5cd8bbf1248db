"""What carries PTP containers between the PC and a camera."""

from typing import Protocol

from .containers import Container


class Link(Protocol):
    """Containers to and from one camera; every failure is a `DeviceError`."""

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send a command, and its data if it has some; `doing` says in messages what for."""

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """The next container with at most so much in it, within `timeout_s` a packet."""

    def event(self, timeout_s: float) -> Container | None:
        """The next event, None if the camera reports none within `timeout_s`."""

    def cancel(self, transaction_id: int) -> None:
        """Have the camera give up a transaction and forget what it still sends."""

    def reset(self) -> None:
        """Put the camera's PTP side back to where it was before; its session is closed."""

    def close(self) -> None:
        """Let go of the camera; never raises."""
