"""Discovery of serial ports, USB cameras and spectrometers, each with its rig file's entry."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import usb.core
import usb.util

from labrig.acquire import SERVICES
from labrig.setup.host import Host, Port, port_users, unreachable

NO_LIBUSB = (
    "libusb is not installed, so USB cameras cannot be seen: install libusb-1.0 (Linux: "
    "libusb-1.0-0, macOS: brew install libusb, Windows: pip install libusb-package)"
)
_STILL_IMAGE = 6
#: USB vendor of Ocean Optics, now Ocean Insight.
_OCEAN_OPTICS = 0x2457
#: Of a reflex camera whose mirror has to swing.
USUAL_SHUTTER_LAG = "60 ms"


@dataclass(frozen=True)
class _Board:
    """Serial devices of a USB vendor; `keys` are those of the device's entry in the rig file."""

    name: str
    driver: str | None = None
    keys: str = ""
    role: str = "lamp"
    hints: tuple[str, ...] = ()


#: Keys for the sketch of the guide "Use boards of your own".
_SKETCH = (
    ', on: {send: "on 0", answer: "ok"}, off: {send: "off 0", answer: "ok"}'
    ', state: {send: "state 0", on: "on", off: "off"}, warm_up: 15 min'
)
_UNKNOWN_HINT = (
    "the device behind it is unknown: if it is a relay board, write its own commands and answers "
    "in place of these"
)


def _unlisted(name: str) -> _Board:
    """Return a board whose commands a person has to fill in."""
    return _Board(name, "serial_relay", _SKETCH, hints=(_UNKNOWN_HINT,))


_MAESTRO = _Board(
    "Pololu Maestro servo controller",
    "maestro",
    ", channel: 0, closed: 1000 us, open: 2000 us, travel: 300 ms",
    role="door",
    hints=(
        "a Maestro shows two ports: its command port is usually the lower one; it has to be set to "
        "USB Dual Port in the Maestro Control Center",
    ),
)

#: Boards by USB vendor and product, or vendor alone. Sources: vendors' manuals, USB ID repository.
_BOARDS: dict[tuple[int, int | None], _Board] = {
    (0x2A19, None): _Board("Numato relay board", "numato", ", relay: 0, warm_up: 15 min"),
    (0x1A86, 0x7523): _Board(
        "CH340 adapter, as on LCUS relay boards and Arduino clones",
        "lcus",
        ", relay: 1, warm_up: 15 min",
        hints=("the device behind it is unknown: use its line only if it is an LCUS board",),
    ),
    (0x1FFB, 0x0089): _MAESTRO,
    (0x1FFB, 0x008A): _MAESTRO,
    (0x1FFB, 0x008B): _MAESTRO,
    (0x1FFB, 0x008C): _MAESTRO,
    (0x1FFB, None): _Board("Pololu servo controller"),
    (0x0403, None): _unlisted("FTDI adapter"),
    (0x10C4, 0xEA60): _unlisted("CP210x adapter"),
    (0x2341, None): _Board(
        "Arduino",
        "serial_relay",
        ", starts_in: 2 s" + _SKETCH,
        hints=("these are the commands of the sketch in the guide 'Use boards of your own'",),
    ),
    (0x1313, 0x8066): _Board(
        "Thorlabs DC4100 LED driver",
        "thorlabs_dc4100",
        ', channels: {"455 nm": {output: 1, brightness: 60 %, centre: 455, fwhm: 18}}',
        role="leds",
        hints=("name each LED head with the output to which it is connected",),
    ),
    (0x1313, None): _Board("Thorlabs instrument"),
    (0x04D8, 0xFFEE): _Board(
        "Devantech relay board",
        "serial_relay",
        ', on: "hex 65", off: "hex 6F", warm_up: 15 min',
        hints=("these are the commands of the first relay; it never acknowledges",),
    ),
}

#: USB vendors whose cameras need proprietary commands for photographs, which `ptp_camera` lacks and
#: libgphoto2 has (its camlibs/ptp2/library.c).
_OWN_COMMANDS = {
    0x054C: "Sony",
    0x04CB: "Fujifilm",
    0x04DA: "Panasonic",
    0x07B4: "Olympus",
    0x33A2: "OM Digital Solutions",
    0x1003: "Sigma",
}


@dataclass(frozen=True)
class FoundDevice:
    """One connected device.

    Attributes
    ----------
    address
        Address for the rig file.
    name
        Maker, model and serial number.
    snippet
        Line for the rig file's `devices:`; empty if labrig has no driver for the device.
    hints
        Obstacles to its use, with remedies.
    """

    address: str
    name: str
    snippet: str = ""
    hints: tuple[str, ...] = ()


@dataclass(frozen=True)
class Discovery:
    """Connected devices.

    Attributes
    ----------
    ports
        Serial ports.
    cameras
        USB cameras.
    notes
        Kinds of devices that could not be looked for, with the reason.
    spectrometers
        USB spectrometers.
    """

    ports: tuple[FoundDevice, ...]
    cameras: tuple[FoundDevice, ...]
    notes: tuple[str, ...] = ()
    spectrometers: tuple[FoundDevice, ...] = ()


def discover(host: Host, drivers: Collection[str]) -> Discovery:
    """List serial ports, USB cameras and spectrometers with their entries for a rig file.

    Nothing is sent to any of the devices.

    Parameters
    ----------
    host
        PC whose devices are listed, such as `Host.of_this_pc()`.
    drivers
        Names of the installed drivers.

    Returns
    -------
    Discovery
        Ports, cameras, spectrometers and notes.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from labrig.setup import Host, discover
    >>> port = SimpleNamespace(
    ...     device="/dev/ttyACM0", description="", vid=0x2A19, pid=0x0C01, serial_number=None
    ... )
    >>> pc = Host("linux", ports=lambda: [port], usb_devices=list, processes=list)
    >>> discover(pc, ["numato"]).ports[0].snippet
    'lamp: {driver: numato, address: "/dev/ttyACM0", relay: 0, warm_up: 15 min}'
    """
    ports = tuple(
        _serial(port, drivers) for port in sorted(host.ports(), key=lambda port: port.device)
    )
    try:
        connected = list(host.usb_devices())
    except usb.core.NoBackendError:
        return Discovery(ports, (), (NO_LIBUSB,))
    shown = {(port.vid, port.pid) for port in host.ports()}
    devices = [device for device in connected if _is_camera(device)]
    model_counts = Counter((device.idVendor, device.idProduct) for device in devices)
    return Discovery(
        ports,
        tuple(
            _camera(device, host, drivers, model_counts[device.idVendor, device.idProduct] > 1)
            for device in devices
        ),
        notes=tuple(_taken(connected, shown, host)),
        spectrometers=tuple(
            _spectrometer(device, host, drivers)
            for device in connected
            if device.idVendor == _OCEAN_OPTICS
        ),
    )


def _serial(port: Port, drivers: Collection[str]) -> FoundDevice:
    if port.vid is None or port.pid is None:
        return FoundDevice(port.device, "not on USB")
    ids = f"{port.vid:04x}:{port.pid:04x}"
    board = _BOARDS.get((port.vid, port.pid)) or _BOARDS.get((port.vid, None))
    serial = f", serial {port.serial_number}" if port.serial_number else ""
    if board is None:
        board = _unlisted(port.description)
        name = f"{board.name} ({ids}{serial}), unknown to labrig"
    else:
        name = f"{board.name} ({ids}{serial})"
    if board.driver not in drivers:
        return FoundDevice(port.device, name)
    return FoundDevice(
        port.device,
        name,
        f'{board.role}: {{driver: {board.driver}, address: "{port.device}"{board.keys}}}',
        board.hints,
    )


def _taken(
    connected: Iterable[Any], shown: Collection[tuple[int | None, int | None]], host: Host
) -> Iterator[str]:
    """Yield a note on each serial board whose port brltty has taken away."""
    if host.platform != "linux" or not any(p.name == "brltty" for p in host.processes()):
        return
    for device in connected:
        identity = device.idVendor, device.idProduct
        if identity in _BOARDS and identity not in shown:
            yield (
                f"{_BOARDS[identity].name} ({identity[0]:04x}:{identity[1]:04x}) is plugged in "
                f"and has no port: {SERVICES['brltty']}"
            )


def _is_camera(device: Any) -> bool:
    try:
        return any(
            interface.bInterfaceClass == _STILL_IMAGE
            for configuration in device
            for interface in configuration
        )
    except (usb.core.USBError, NotImplementedError):
        return False  # a device that does not even show its descriptors is none of ours


def _camera(device: Any, host: Host, drivers: Collection[str], has_twin: bool) -> FoundDevice:
    address = f"usb://{device.idVendor:04x}:{device.idProduct:04x}"
    obstacle = unreachable(device, host.platform)
    hints = [obstacle] if obstacle else []
    hints += [f"may be held by {holder}" for holder in port_users(device, host)]
    serial = None if obstacle else _text(device, device.iSerialNumber)
    if has_twin and serial:
        address += f"/{serial}"
    elif has_twin:
        hints.append("there are several of this model: append /SERIAL, see labrig rig check")
    name_parts = (
        [] if obstacle else [_text(device, device.iManufacturer), _text(device, device.iProduct)]
    )
    usb.util.dispose_resources(device)
    driver: str | None = "ptp_camera"
    if maker := _OWN_COMMANDS.get(device.idVendor):
        driver = None if host.platform == "win32" else "gphoto2_camera"
        hints.append(
            f"{maker} has commands of its own, which libgphoto2 knows (Linux, macOS): "
            "pip install 'labrig[gphoto2]'"
        )
    snippet = (
        f'camera: {{driver: {driver}, address: "{address}", warm_up: 30 min, '
        f"shutter_lag: {USUAL_SHUTTER_LAG}}}"
    )
    hints.append(
        f"no camera reports its shutter_lag: {USUAL_SHUTTER_LAG} is usual, the protocol 'fade' "
        "measures it"
    )
    return FoundDevice(
        address,
        " ".join(word for word in name_parts if word) or "camera",
        snippet if driver in drivers else "",
        tuple(hints),
    )


def _spectrometer(device: Any, host: Host, drivers: Collection[str]) -> FoundDevice:
    address = f"usb://{device.idVendor:04x}:{device.idProduct:04x}"
    obstacle = unreachable(device, host.platform)
    driver = "seabreeze_spectrometer"
    hints = [obstacle] if obstacle else []
    hints += [f"may be held by {holder}" for holder in port_users(device, host)]
    hints.append("needs python-seabreeze: pip install 'labrig[seabreeze]'")
    usb.util.dispose_resources(device)
    return FoundDevice(
        address,
        "Ocean Optics spectrometer",
        f'spectrometer: {{driver: {driver}, address: "{address}"}}' if driver in drivers else "",
        tuple(hints),
    )


def _text(device: Any, index: int) -> str | None:
    if not index:
        return None
    try:
        text: str | None = usb.util.get_string(device, index)
    except (usb.core.USBError, NotImplementedError, ValueError):
        return None
    return text
