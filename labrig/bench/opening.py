"""Opening of a rig: here drivers and clock meet the simulated room, if there is one."""

import os
import re
import socket
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, wait
from contextlib import (
    AbstractContextManager,
    ExitStack,
    closing,
    contextmanager,
    nullcontext,
    suppress,
)
from dataclasses import dataclass, field
from functools import partial
from mmap import mmap
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import serial
import usb.core

from labrig.acquire import (
    CAMERA,
    PORT_FAILURES,
    Device,
    DeviceEntry,
    Rig,
    RigFile,
    SerialPort,
    driver_and_settings,
    in_safe_order,
    load_driver,
    not_opened,
    require_own_ports,
)
from labrig.bench.awake import kept_awake
from labrig.bench.device_lock import held, network_devices, serial_devices, usb_device
from labrig.bench.guard import Guard, guarding
from labrig.bench.serial_ports import SerialPorts
from labrig.consent import NETWORK_SCHEMES, calls, require_consent
from labrig.foundation.activity import checking
from labrig.foundation.clock import CHECK_INTERVAL_S, Clock, SystemClock
from labrig.foundation.errors import DeviceError, LabrigError, UsageError
from labrig.foundation.named_files import with_absolute_paths
from labrig.foundation.output_file import REAL_DISK, Disk
from labrig.foundation.signals import interrupting, pausing

if TYPE_CHECKING:
    from labrig.sim import OpenRoom

SERIAL_WRITE_TIMEOUT_S = 2.0
TCP_CONNECT_TIMEOUT_S = 5.0
#: Memory kept for the way to the safe state; the system gives it only once it is used.
RESERVE_BYTES = 16_000_000
_NETWORK_PORT = "socket://"
#: Serial ports whose names are no paths: of Windows, in a simulated room, and behind a network.
_PORT = re.compile(r"(?:\\\\\.\\)?(?i:COM|CNC[AB])\d+|sim://.+|socket://[^/?#@\s]+:\d{1,5}")
#: Devices that are serial ports, unlike a disk or a watchdog, which opening alone sets off.
_TERMINAL = re.compile(r"/dev/(tty|cu|pts/|rfcomm)")
#: What opening a serial port raises; pyserial says of some wrong addresses that they are no value.
_NOT_OPENED: tuple[type[Exception], ...] = (*PORT_FAILURES, ValueError)


@dataclass(frozen=True)
class Bench:
    """A rig before its devices are opened: file, clock, simulated room, guard, ports and disk.

    Devices in `left_out`, keys of the rig file, are not opened. The disk is that of the PC to which
    the rig is connected.
    """

    file: RigFile
    source: str
    clock: Clock
    room: "OpenRoom | None"
    guard: Guard | None = None
    ports: SerialPorts = field(default_factory=SerialPorts)
    left_out: frozenset[str] = frozenset()
    disk: Disk = REAL_DISK

    @property
    def guarded_by(self) -> str:
        """Description for the record of what switches the lights off if this process cannot."""
        if self.guard is not None:
            return self.guard.described
        return "nothing: no light of this rig outlives the process that runs it"

    @property
    def seed(self) -> int | None:
        """Seed of everything random in a simulated rig; `None` on a real bench."""
        return None if self.room is None else self.room.seed

    def kept_awake(self, warn: Callable[[str], None]) -> AbstractContextManager[None]:
        """Keep the PC awake; not for a simulated room, whose time stops while the PC sleeps."""
        return kept_awake(warn) if self.room is None else nullcontext()

    @contextmanager
    def devices(self) -> Iterator[Rig]:
        """Open the devices, each at once brought to its safe state, and make them safe at the end.

        Ctrl-C and similar signals are handled at waits, and never prevent the safe state.

        Raises
        ------
        DeviceError
            A device is missing, or cannot confirm that it is safe; or the guard cannot be started.
        UsageError
            Another labrig holds one of the addresses, or two devices have one.
        Interrupted
            A stop was requested.
        """
        with ExitStack() as stack:
            stack.enter_context(interrupting(self.clock))
            stack.enter_context(pausing(self.clock))
            # A protocol that reduces its frames can be stopped between two of them.
            stack.enter_context(checking(partial(self.clock.sleep, 0.0)))
            # Entered first, so that ports close after the devices on them are safe.
            transports = stack.enter_context(ExitStack())
            require_own_ports(self.file, self.source)
            connections = _Connections(self.clock, self.room, transports, self.ports)
            warm_up_s = {key: entry.warm_up for key, entry in self.file.devices.items()}
            rig = Rig(self.file.name, self.clock, {}, warm_up_s)
            stack.callback(rig.disconnect)
            stack.callback(self._make_safe, rig)
            # Freed first, so that lack of memory does not prevent the safe state.
            stack.callback(mmap(-1, RESERVE_BYTES).close)
            opened = [key for key in self.file.devices if key not in self.left_out]
            for key in in_safe_order(opened):
                rig.connect(key, partial(_open, self.file, key, connections, self.source))
            if self.guard is not None:
                self.guard.watch()
                rig.lights_may_be_on = self.guard.lights_may_be_on
            yield rig

    def _make_safe(self, rig: Rig) -> None:
        """Make the rig safe; the guard stands down only when all lights are off."""
        try:
            rig.make_safe()
        except DeviceError as error:
            guard = self.guard
            # Where no light was lit yet, there is none, and a next labrig needs the port.
            if guard and guard.is_started and not guard.lights.isdisjoint(error.unsafe):
                with suppress(DeviceError):  # without a guard there is nothing to add
                    guard.watch()
                    error.args = (f"{error}; when labrig has ended, {guard.goes_on}",)
            raise
        if self.guard is not None and self.guard.lights <= rig.devices.keys():
            self.guard.stand_down()


@contextmanager
def open_bench(file: RigFile, source: str, not_before_s: float = 0.0) -> Iterator[Bench]:
    """Open the bench that a rig file describes, without connecting a device yet.

    Parameters
    ----------
    file
        The validated rig file.
    source
        Path of the rig file, for messages.
    not_before_s
        Earliest time, in seconds since 1970, at which the clock of a simulated room starts: a
        resumed run continues after its last journal line.

    Yields
    ------
    Bench
        The bench with its clock; `Bench.devices` opens the devices.

    Raises
    ------
    UsageError
        An address leads to a network, and this user did not consent to it on this PC.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> path = Path("runs/decay/rig.yaml")
    >>> opened = labrig.open_bench(labrig.read_rig_file(path), str(path))
    >>> with opened as bench, bench.devices() as rig:
    ...     print(sorted(rig.devices))
    ['camera', 'changer', 'door', 'lamp', 'shield', 'thermometer']
    """
    require_consent(calls(file.addresses()), source)
    if file.simulation is None:
        with guarding(file, source) as guard:
            yield Bench(file, source, SystemClock(), None, guard)
        return
    from labrig import sim  # a real bench has no need of the room's physics

    with sim.open_room(_room(file, source), source, not_before_s) as room:
        yield Bench(file, source, room.clock, room, disk=room.failing(REAL_DISK))


def wall_at_start(file: RigFile, source: str) -> float:
    """Return the time in seconds since 1970 at which a run on a rig would begin now.

    Parameters
    ----------
    file
        The validated rig file.
    source
        Path of the rig file, for messages.

    Returns
    -------
    float
        Time of the PC's clock; of a simulated room its epoch.

    Examples
    --------
    >>> import labrig
    >>> from labrig.bench import wall_at_start
    >>> wall_at_start(labrig.read_rig_file("runs/decay/rig.yaml"), "rig.yaml")
    1767225600.0
    """
    if file.simulation is None:
        return SystemClock().wall()
    from labrig import sim

    return sim.describe_room(_room(file, source), source).epoch_s


def with_frame_size(file: RigFile, source: str) -> RigFile:
    """Return a rig file that says how large its camera's frames are, if they are simulated.

    Paths of files that the simulated room names are absolute in the result.
    A real camera's are said by the keys `frame_pixels` and `frame_size`, or seen in its first
    frame. The description of the simulated room is checked.

    Parameters
    ----------
    file
        The validated rig file.
    source
        Path of the rig file, for messages.

    Returns
    -------
    RigFile
        The file, with these keys of a simulated camera filled in.

    Raises
    ------
    UsageError
        The description of the room is malformed, names an unknown material, or contradicts the
        keys of the camera.

    Examples
    --------
    >>> import labrig
    >>> from labrig.bench import with_frame_size
    >>> rig = labrig.read_rig_file("runs/decay/rig.yaml")
    >>> with_frame_size(rig, "rig.yaml").devices["camera"].settings()["frame_pixels"]
    [96, 64]
    """
    if file.simulation is None:
        return file
    from labrig import sim

    content = _room(file, source)
    file = file.model_copy(update={"simulation": content})
    room = sim.describe_room(content, source)
    entry = file.devices.get(CAMERA.key)
    if entry is None:
        return file
    given, driver = entry.settings(), load_driver(CAMERA.key, entry.driver, source)
    sizes = {"frame_pixels": list(room.frame_pixels), "frame_size": f"{room.frame_bytes} B"}
    if given.get("frame_pixels", sizes["frame_pixels"]) != sizes["frame_pixels"]:
        raise UsageError(
            f"{source}, devices.camera: expected frame_pixels {sizes['frame_pixels']}, as "
            f"'simulation.sensor' says, got {given['frame_pixels']}; leave it out"
        )
    known = {key: size for key, size in sizes.items() if key in driver.Settings.model_fields}
    completed = DeviceEntry.model_validate(entry.model_dump() | known | given)
    return file.model_copy(update={"devices": {**file.devices, CAMERA.key: completed}})


def serve_camera(file: RigFile, source: str, port: int, tell: Callable[[str], None]) -> None:
    """Serve a simulated rig's camera to other programs on this PC, as PTP/IP, in real time.

    Parameters
    ----------
    file
        The validated rig file.
    source
        Path of the rig file, for messages.
    port
        TCP port on the loopback network; 0 for any free one.
    tell
        Callback that receives the address once it can be reached.

    Raises
    ------
    UsageError
        The rig is not simulated, or the port is taken.
    Interrupted
        A stop was requested, which is the only way to end.

    Examples
    --------
    >>> import signal
    >>> import labrig
    >>> from labrig.bench import serve_camera
    >>> from labrig.foundation.clock import Interrupted
    >>> def tell(address):
    ...     print(address.partition(":")[0])
    ...     raise Interrupted(signal.SIGINT)  # Ctrl-C, as soon as the camera can be reached
    >>> try:
    ...     serve_camera(labrig.read_rig_file("runs/decay/rig.yaml"), "rig.yaml", 0, tell)
    ... except Interrupted:
    ...     print("stopped")
    ptpip
    stopped
    """
    if file.simulation is None:
        raise UsageError(
            f"{source}: expected a simulated rig, this one has no 'simulation:'; try --rig sim"
        )
    from labrig import sim
    from labrig.sim import camera

    clock = SystemClock()
    with interrupting(clock), sim.open_room(_room(file, source), source) as room:
        pace = camera.Pace(clock, room.clock)
        with closing(camera.PtpIpServer(room.camera.responder, pace.catch_up, port)) as server:
            tell(server.address)
            server.serve(clock)


def _room(file: RigFile, source: str) -> dict[str, Any]:
    """Return the content of a simulated room with absolute paths of the files that it names."""
    from labrig.sim import Simulation

    folder = Path(source).resolve().parent
    return with_absolute_paths(file.simulation or {}, Simulation, folder)


def _open(file: RigFile, key: str, connections: "_Connections", source: str) -> Device:
    driver, settings = driver_and_settings(file, key, source)
    device: Device = driver(file.devices[key].address, settings, connections)
    return device


class _Connections:
    """Opener of ports, each once by whatever name; real devices are locked for this labrig."""

    def __init__(
        self, clock: Clock, room: "OpenRoom | None", stack: ExitStack, names: SerialPorts
    ) -> None:
        self.clock = clock
        self._room = room
        self._stack = stack
        self._names = names
        self._ports: dict[tuple[str, ...], SerialPort] = {}
        self._settings: dict[tuple[str, ...], tuple[int, str]] = {}
        self._locked: set[str] = set()

    def serial(self, address: str, baudrate: int, framing: str = "8N1") -> SerialPort:
        _require_port(address)
        try:
            port = serial.serial_for_url(
                self._names.look_up(address),
                do_not_open=True,
                baudrate=baudrate,
                bytesize=int(framing[0]),
                parity=framing[1],
                stopbits=int(framing[2]),
                timeout=0,
                write_timeout=SERIAL_WRITE_TIMEOUT_S,
                exclusive=True,
            )
            if address.startswith(_NETWORK_PORT):
                devices = tuple(network_devices(*_host_and_port(address, 0)))
            else:
                devices = tuple(serial_devices(str(port.port)))
            if devices not in self._ports:
                self._lock(devices, address)
                port.open()
                self._stack.callback(_close, port)
                self._ports[devices] = port
                self._settings[devices] = baudrate, framing
        except _NOT_OPENED as error:
            raise DeviceError(
                f"cannot open the serial port {address} ({' '.join(str(error).split())}); "
                f"{not_opened(error, address)}"
            ) from None
        if self._settings[devices] != (baudrate, framing):
            other_baudrate, other_framing = self._settings[devices]
            raise UsageError(
                f"two devices of the rig use the serial port {address}, one at {other_baudrate} "
                f"baud, {other_framing}, the other at {baudrate} baud, {framing}; give both the "
                "same"
            )
        return self._ports[devices]

    def usb(self, address: str, serial_of: Callable[[Any], str] | None = None) -> Any:
        url = urlsplit(address)
        if url.scheme == "sim":
            backend = None if self._room is None else self._room.usb(url.path.strip("/"))
            device = None if backend is None else usb.core.find(backend=backend)
        elif url.scheme == "usb":
            device = self._find(address, serial_of)
        else:
            raise UsageError(
                f"'{address}' is no USB address; write usb://VENDOR:PRODUCT in hexadecimal, such "
                "as usb://04a9:3199, with /SERIAL behind it if there are several"
            )
        if device is None:
            raise DeviceError(
                f"no device at {address}; switch it on and check its cable (a camera that went to "
                "sleep is off, too)"
            )
        return device

    def tcp(self, address: str, default_port: int) -> socket.socket:
        host, port = _host_and_port(address, default_port)
        try:
            self._lock(network_devices(host, port), address)
            connected = self._connected(host, port)
            # commands are small, and somebody waits for the answer to each
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (OSError, UnicodeError) as error:
            raise DeviceError(
                f"no answer from {address} ({error}); check that the device is on and in the "
                "same network, and its address"
            ) from None
        self._stack.callback(connected.close)
        return connected

    def _connected(self, host: str, port: int) -> socket.socket:
        """Return a connection; the system looks for it in a thread, so that Ctrl-C acts at once."""
        attempt: Future[socket.socket] = Future()

        def connect() -> None:
            try:
                attempt.set_result(socket.create_connection((host, port), TCP_CONNECT_TIMEOUT_S))
            except Exception as error:
                attempt.set_exception(error)

        threading.Thread(target=connect, daemon=True).start()
        while not attempt.done():
            wait([attempt], CHECK_INTERVAL_S)
            self.clock.sleep(0.0)
        return attempt.result()

    def _find(self, address: str, serial_of: Callable[[Any], str] | None) -> Any:
        url = urlsplit(address)
        try:
            vendor, product = (int(part, 16) for part in url.netloc.split(":"))
        except ValueError:
            raise UsageError(
                f"'{address}' is no USB address; write usb://VENDOR:PRODUCT in hexadecimal, such "
                "as usb://04a9:3199"
            ) from None
        serial = url.path.strip("/")
        try:
            candidates = list(usb.core.find(find_all=True, idVendor=vendor, idProduct=product))
            if serial:
                device = _with_serial(candidates, serial, address, serial_of)
            else:
                device = candidates[0] if candidates else None
            if device is not None:
                self._lock([usb_device(device)], address)
            return device
        except usb.core.NoBackendError:
            raise DeviceError(
                "libusb is not installed, so USB cameras cannot be reached; install libusb-1.0 "
                "(Linux: libusb-1.0-0, macOS: brew install libusb, Windows: the package "
                "libusb-package)"
            ) from None
        except (usb.core.USBError, ValueError) as error:
            raise DeviceError(
                f"{address} refuses access ({error}); on Linux allow it by a udev rule, on Windows "
                "give the camera the WinUSB driver"
            ) from None

    def _lock(self, devices: Iterable[str], address: str) -> None:
        """Lock real devices against other labrigs; a simulated room is private to its process."""
        for device in devices:
            if device not in self._locked and not address.startswith("sim://"):
                self._stack.enter_context(held(device, address))
                self._locked.add(device)


def _close(port: SerialPort) -> None:
    """Close a port, which may be gone: whatever failed for that has been told."""
    with suppress(*PORT_FAILURES):
        port.close()


def _with_serial(
    candidates: list[Any], serial: str, address: str, serial_of: Callable[[Any], str] | None
) -> Any:
    """Return the device with that serial number; devices without one on the bus are queried."""
    other_numbers = []
    problem: LabrigError | None = None
    for device in sorted(candidates, key=lambda device: not device.iSerialNumber):
        try:
            if device.iSerialNumber:
                serial_number = device.serial_number
            elif serial_of:
                with held(usb_device(device), address):
                    serial_number = serial_of(device)
            else:
                serial_number = ""
        except (DeviceError, UsageError) as failure:
            problem = failure
            continue
        if serial_number.strip().lstrip("0") == serial.lstrip("0"):
            return device
        other_numbers.append(serial_number or "unknown")
    if problem:
        raise problem
    if other_numbers:
        raise DeviceError(
            f"no device with the serial number {serial}; of this kind there are "
            f"{', '.join(other_numbers)}"
        )
    return None


def _require_port(address: str) -> None:
    """Refuse what pyserial would do beside opening a port: `spy://` empties a file, for example.

    Raises
    ------
    UsageError
        The address is neither a port, nor one behind a network, nor in a simulated room.
    """
    is_terminal = _TERMINAL.match(os.path.realpath(address)) or not Path(address).exists()
    if not _PORT.fullmatch(address) and ("://" in address or not is_terminal):
        raise UsageError(
            f"'{address}' is no serial port; write COM3, /dev/…, socket://HOST:PORT for one behind "
            "a network or, in a simulated room, sim://room/DEVICE"
        )


def _host_and_port(address: str, default_port: int) -> tuple[str, int]:
    url = urlsplit(address)
    try:
        host, port = url.hostname, url.port
    except ValueError:
        host, port = None, None
    # Of other schemes nobody was asked for consent.
    if not host or url.path.strip("/") or url.scheme not in NETWORK_SCHEMES:
        raise UsageError(
            f"'{address}' is no network address; write {url.scheme}://HOST or "
            f"{url.scheme}://HOST:PORT, such as {url.scheme}://192.168.1.20, with one of the "
            f"schemes {', '.join(NETWORK_SCHEMES)}"
        )
    return host, default_port if port is None else port
