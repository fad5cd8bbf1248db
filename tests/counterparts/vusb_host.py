"""Our driver photographs with libgphoto2's virtual camera, in a process of its own.

    python -m tests.counterparts.vusb_host camera|session|until-full PICTURES

prints what it found as JSON: as the role that a rig file names, or step by step below it.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any, NoReturn

import usb.core

from labrig.acquire import Camera, ExposureSettings
from labrig.acquire.connections import SerialPort
from labrig.drivers.ptp import PtpCamera
from labrig.drivers.ptp.codes import Standard, StandardEvent, StandardProperty
from labrig.drivers.ptp.device_info import DeviceInfo, parse_device_info
from labrig.drivers.ptp.object_transfer import ObjectTransfer
from labrig.drivers.ptp.session import Session
from labrig.drivers.ptp.standard.frames import StandardFrames
from labrig.drivers.ptp.standard.object_info import FOLDER, parse_object_info
from labrig.drivers.ptp.standard.properties import StandardProperties
from labrig.drivers.ptp.usb.link import UsbLink
from labrig.foundation.clock import SystemClock
from labrig.foundation.errors import DeviceError

from .vusb import VirtualBus, VirtualCamera

ADDRESS = "usb://04b0:0437"
CLOCK = SystemClock()
EVENT_S = 2.0
MAX_FRAMES = 60


class OnTheBus:
    """Connections to the virtual camera alone."""

    clock = CLOCK

    def __init__(self, bus: VirtualBus) -> None:
        self._bus = bus

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        raise AssertionError("no serial line here")

    def usb(self, address: str, serial_of: object = None) -> Any:
        return usb.core.find(backend=self._bus)

    def tcp(self, address: str, default_port: int) -> NoReturn:
        raise AssertionError("no network here")


def refusal(camera: PtpCamera) -> str:
    try:
        camera.shoot()
    except DeviceError as error:
        return str(error)
    raise AssertionError("this camera delivers nothing but JPEG")


def as_camera(bus: VirtualBus) -> dict[str, Any]:
    settings = PtpCamera.Settings.model_validate({"isos": [100], "transfer_timeout": "5 s"})
    camera = PtpCamera(ADDRESS, settings, OnTheBus(bus))
    assert isinstance(camera, Camera)
    capabilities = camera.capabilities()
    findings = [(each.severity, str(each)) for each in camera.findings()]
    in_force = camera.configure(ExposureSettings(0.02, 100, capabilities.f_numbers[0]))
    refused = [refusal(camera) for _ in range(2)]
    camera.make_safe()
    camera.disconnect()
    return {
        "identity": camera.identity(),
        "exposures_s": capabilities.exposures_s,
        "f_numbers": capabilities.f_numbers,
        "findings": findings,
        "in_force": str(in_force),
        "refused": refused,
    }


def opened(bus: VirtualBus) -> tuple[Session, DeviceInfo]:
    session = Session(UsbLink(usb.core.find(backend=bus), ADDRESS, CLOCK), CLOCK)
    session.open()
    return session, parse_device_info(session.transact(Standard.GetDeviceInfo).data)


def until_full(bus: VirtualBus) -> dict[str, Any]:
    session, info = opened(bus)
    frames = StandardFrames(session, CLOCK, info, EVENT_S)
    said: list[str] = []
    while len(said) < MAX_FRAMES and "StoreFull" not in " ".join(said):
        frames.expect(CLOCK.now())
        session.transact(Standard.InitiateCapture, 0, 0)
        try:
            frames.fetch()
        except DeviceError as error:
            said.append(str(error))
    try:
        session.transact(Standard.InitiateCapture, 0, 0)
    except DeviceError as error:
        said.append(str(error))
    return {"said": said}


def as_session(bus: VirtualBus) -> dict[str, Any]:
    session, info = opened(bus)
    properties = StandardProperties(session, CLOCK, info.properties, 1.0)
    described = properties.describe(StandardProperty.exposure_time)
    assert described is not None
    said = properties.set(StandardProperty.exposure_time, described, 500)
    again = properties.describe(StandardProperty.exposure_time)
    assert again is not None
    session.transact(Standard.InitiateCapture, 0, 0)
    pictures, events = [], []
    transfer = ObjectTransfer(session, CLOCK, Standard.GetObject, None)
    while (event := session.event(EVENT_S)) is not None:
        events.append(event.code)
        if event.code == StandardEvent.CaptureComplete:
            break
        assert event.code == StandardEvent.ObjectAdded
        (handle,) = event.params
        added = parse_object_info(session.transact(Standard.GetObjectInfo, handle).data)
        if added.object_format != FOLDER:
            data = transfer.fetch(handle, added.name, added.size_bytes)
            digest = hashlib.sha256(data).hexdigest()
            pictures.append({"name": added.name, "sha256": digest, "is_raw": added.is_raw})
            session.transact(Standard.DeleteObject, handle, 0)
    session.close()
    return {
        "choices": list(described.choices),
        "set": [said, again.value],
        "events": events,
        "pictures": pictures,
    }


if __name__ == "__main__":
    as_what, pictures = sys.argv[1:]
    drive = {"camera": as_camera, "session": as_session, "until-full": until_full}[as_what]
    print(json.dumps(drive(VirtualBus(VirtualCamera(Path(pictures))))))
