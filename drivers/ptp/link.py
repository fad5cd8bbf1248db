"""Transport of PTP containers between the PC and a camera."""

from typing import Protocol

from .containers import Container


class Link(Protocol):
    """Containers to and from one camera; every failure is a `DeviceError`."""

    def send(self, request: Container, data: bytes | None, doing: str) -> None:
        """Send a command, and its data if it has some; `doing` is its purpose in messages."""

    def receive(self, doing: str, timeout_s: float, at_most_bytes: int) -> Container:
        """Return the next container of limited length, within `timeout_s` for each packet."""

    def event(self, timeout_s: float) -> Container | None:
        """Return the next event, None if the camera reports none within `timeout_s`."""

    def cancel(self, transaction_id: int) -> None:
        """Make the camera cancel a transaction and discard what it still sends."""

    def reset(self) -> None:
        """Reset the camera's PTP side; its session is closed."""

    def close(self) -> None:
        """Close the connection with the camera; never raises."""
