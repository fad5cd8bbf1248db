"""Common interface of all kinds of PTP cameras once a session with them is open."""

from collections.abc import Callable, Sequence
from typing import Protocol

from labrig.acquire import CameraOffers, ExposureSettings, Finding, Frame


class Body(Protocol):
    """One kind of camera; methods that are not described here are those of the roles."""

    def take_control(self) -> None:
        """Apply the settings that control by a PC needs, and read them back."""

    def take_over(self) -> None:
        """Take control where a dead program, or a reset, left the camera in an unknown state."""

    def give_back(self) -> None:
        """Give the camera back to its own buttons."""

    def offers(self) -> CameraOffers:
        """Return the exposure settings that the camera offers now."""

    def findings(self) -> Sequence[Finding]:
        """Return findings on the camera's manual settings, as far as it reports them."""

    def keep_awake(self) -> None:
        """Postpone the camera's automatic switching-off."""

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        """Apply exposure settings and read them back."""

    def arm(self) -> None:
        """Do all that can be done before the release."""

    def shoot(self) -> Frame:
        """Release now, wait for the exposure, transfer the frame."""

    def preview(self) -> bytes:
        """Return one live picture, a JPEG."""

    def steps_to_safety(self) -> Sequence[Callable[[], None]]:
        """Return the steps that make the camera safe, all of which are tried in this order."""
