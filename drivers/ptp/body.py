"""What kinds of PTP cameras have in common once a session with them is open."""

from collections.abc import Callable, Sequence
from typing import Protocol

from labrig.acquire import CameraOffers, ExposureSettings, Finding, Frame


class Body(Protocol):
    """One kind of camera; its methods are those of the roles, where not described here."""

    def take_control(self) -> None:
        """Set what a PC must have set before it photographs, read back."""

    def take_over(self) -> None:
        """As `take_control`, where a program that died, or a reset, left things as they were."""

    def give_back(self) -> None:
        """Give the camera back to its own buttons."""

    def offers(self) -> CameraOffers:
        """What it can be set to, as it is now."""

    def findings(self) -> Sequence[Finding]:
        """How it is set by hand, as far as it tells."""

    def keep_awake(self) -> None:
        """Put off its automatic switching-off."""

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Set and read back."""

    def arm(self) -> None:
        """Do all that can be done beforehand."""

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame."""

    def preview(self) -> bytes:
        """One live picture, a JPEG."""

    def steps_to_safety(self) -> Sequence[Callable[[], None]]:
        """What must be done for it to be safe, all of it tried in this order."""
