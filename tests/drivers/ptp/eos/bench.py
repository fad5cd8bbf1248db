"""A toy camera on a wire, and the driver on it."""

from dataclasses import dataclass

from labrig.acquire.values import ExposureSettings, Frame
from labrig.drivers.ptp import PtpCamera
from labrig.foundation.clock import VirtualClock

from ..usb.wire import OneDevice, Wire
from .toy import ToyEos

ADDRESS = "usb://04a9:3199"
SHORT = ExposureSettings(1 / 64, 200, 5.6)


@dataclass(frozen=True)
class Bench:
    """Everything on the desk."""

    toy: ToyEos
    wire: Wire

    def connect(self, **settings: object) -> PtpCamera:
        """The driver, connected; rig file keys as they are written there."""
        parsed = PtpCamera.Settings.model_validate(settings)
        return PtpCamera(ADDRESS, parsed, OneDevice(self.wire))


def bench(toy: ToyEos | None = None, clock: VirtualClock | None = None) -> Bench:
    toy = toy or ToyEos()
    return Bench(toy, Wire(toy, clock or VirtualClock()))


def photograph(camera: PtpCamera, settings: ExposureSettings = SHORT) -> Frame:
    """What a protocol does for each frame."""
    assert camera.configure(settings) == settings
    camera.arm()
    return camera.shoot()
