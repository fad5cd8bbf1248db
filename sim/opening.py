"""Opening of a simulated room: boards on serial lines, a camera and a spectrometer on USB."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import usb.backend

from labrig.foundation.clock import VirtualClock
from labrig.foundation.output_file import Disk
from labrig.foundation.yaml_file import validate

from . import protocol_sim
from .boards import (
    ArduinoBoard,
    ChangerBoard,
    CornerstoneBoard,
    Dc4100Board,
    Fw102cBoard,
    LcusBoard,
    MaestroBoard,
    NumatoBoard,
    SerialCable,
)
from .boards.dc4100 import OUTPUTS
from .camera import SimulatedCamera
from .camera.faults import CameraFaults
from .faults import Fault, FaultTime, given
from .pc import RoomClock, SimulatedDisk
from .room import Room
from .simulation import Simulation
from .spectrometer import Detector, SpectrometerBackend, UsbSpectrometer
from .temperature import TemperatureSensor

#: The address of the room: `sim://room/relays`, `sim://room/lcus`, `sim://room/arduino`,
#: `sim://room/servo`, `sim://room/changer`, `sim://room/camera`, `sim://room/spectrometer`; with
#: LEDs on Thorlabs units `sim://room/dc4100-1` to `sim://room/dc4100-3`, with a bank of lamps
#: `sim://room/lamps`, with a filter wheel `sim://room/wheel`, with one before the
#: camera `sim://room/camera-wheel`, with a monochromator `sim://room/monochromator`.
NAME = "room"
#: Relay that carries the lamp, the first one of its board, as the board counts.
LAMP_RELAY = {"relays": 0, "arduino": 0, "lcus": 1}
RELAYS = 8
LCUS_RELAYS = 8
ARDUINO_RELAYS = 4
DC4100_UNITS = 3
#: Analogue input of the Numato board that has the thermometer.
TEMPERATURE_INPUT = 0
#: Stream of random numbers of the thermometer alone.
TEMPERATURE_STREAM = 9
#: Streams of random numbers of the spectrometer's pixels, and of its noise.
PIXEL_STREAM, SPECTRUM_STREAM = 10, 11


class OpenRoom:
    """The open room, its clock, its boards, its camera and its spectrometer."""

    def __init__(self, simulation: Simulation, clock: VirtualClock) -> None:
        self.clock = clock
        self.seed = simulation.seed
        servo = _servo_board(simulation, clock)
        self.room = Room(simulation, clock, servo.pulses)
        faults = simulation.faults
        temperature = TemperatureSensor(
            simulation.temperature,
            clock,
            np.random.default_rng([simulation.seed, TEMPERATURE_STREAM]),
            given(fault.thermometer_off for fault in faults),
        )
        relays = NumatoBoard(
            RELAYS,
            lambda relay, on: self._relay_moved("relays", relay, on),
            {TEMPERATURE_INPUT: temperature.volts},
        )
        lcus = LcusBoard(
            LCUS_RELAYS, lambda relay, on: self._relay_moved("lcus", relay, on), simulation.lcus
        )
        arduino = ArduinoBoard(
            ARDUINO_RELAYS, lambda relay, on: self._relay_moved("arduino", relay, on), clock
        )
        self._lamp_board = simulation.lamp.board
        self._led_board: str = simulation.led_board
        if self._led_board == "relays" and self._lamp_board == "arduino":
            self._led_board = "arduino"
        relay_boards: dict[str, NumatoBoard | LcusBoard | ArduinoBoard] = {
            "relays": relays,
            "lcus": lcus,
            "arduino": arduino,
        }
        relay_boards[self._lamp_board].states[0] = simulation.initial.lamp == "on"
        units = _dc4100_units(simulation, self.room)
        lamps = (
            {"lamps": NumatoBoard(RELAYS, self.room.switch_illuminant)}
            if simulation.illuminants
            else {}
        )
        for relay in simulation.initial.leds:
            if self._led_board == "dc4100":
                units[f"dc4100-{1 + (relay - 1) // OUTPUTS}"].states[(relay - 1) % OUTPUTS] = True
            else:
                first = LAMP_RELAY[self._led_board]
                relay_boards[self._led_board].states[relay - first] = True
        selectors: dict[str, Fw102cBoard | CornerstoneBoard] = {}
        if simulation.filter_wheel is not None:
            selectors["wheel"] = Fw102cBoard(self.room.turn_wheel, clock)
        if simulation.camera_filter_wheel is not None:
            selectors["camera-wheel"] = Fw102cBoard(self.room.turn_camera_wheel, clock)
        if simulation.monochromator is not None:
            selectors["monochromator"] = CornerstoneBoard(self.room.tune, clock)
        changer = ChangerBoard(self.room.tasks)
        for task in simulation.initial.manual_steps:
            changer.do(task)
        pulled = given(fault.board_unplugged for fault in faults)

        def pulls(board: str) -> tuple[FaultTime, ...]:
            return tuple(pull for pull in pulled if pull.board == board)

        self.boards = {
            name: SerialCable(board, clock, unplugged=pulls(name))
            for name, board in {"servo": servo, "changer": changer, **selectors}.items()
        } | {
            name: SerialCable(
                board,
                clock,
                unplugged=(*given(fault.relays_unplugged for fault in faults), *pulls(name)),
                silent=given(fault.relays_silent for fault in faults),
                echo_lost=given(fault.relays_echo_lost for fault in faults),
            )
            for name, board in (relay_boards | units | lamps).items()
        }
        self.camera = SimulatedCamera(
            clock,
            self.room,
            serial="0730100001",
            seed=simulation.seed,
            faults=_camera_faults(faults),
            body=simulation.camera,
        )
        detector = Detector(np.random.default_rng([simulation.seed, PIXEL_STREAM]))
        self.spectrometer = SpectrometerBackend(
            clock,
            UsbSpectrometer(
                clock,
                self.room.spectrometer_exposure,
                detector,
                "USB2P00001",
                (simulation.seed, SPECTRUM_STREAM),
            ),
            unplugged=given(fault.spectrometer_unplugged for fault in faults),
            silent=given(fault.spectrometer_silent for fault in faults),
            truncated=given(fault.spectrometer_truncated for fault in faults),
        )
        self._faults = faults

    def failing(self, disk: Disk) -> SimulatedDisk:
        """Return the PC's disk, which writes by another one and has the room's faults."""
        return SimulatedDisk(
            disk,
            self.clock,
            full=given(fault.disk_full for fault in self._faults),
            slow=given(fault.disk_slow for fault in self._faults),
        )

    def usb(self, device: str) -> usb.backend.IBackend | None:
        """Return the USB bus on which `device` is alone; None if there is no such device."""
        return {"camera": self.camera.backend, "spectrometer": self.spectrometer}.get(device)

    def _relay_moved(self, board: str, relay: int, on: bool) -> None:
        if (board, relay) == (self._lamp_board, LAMP_RELAY[self._lamp_board]):
            self.room.switch_lamp(on)
        elif board == self._led_board:
            self.room.switch_led(relay, on)


@contextmanager
def open_room(
    content: Mapping[str, Any], source: str, not_before_s: float = 0.0
) -> Iterator[OpenRoom]:
    """Build the room that a rig file's `simulation:` describes and make it reachable.

    While the context is open, pyserial finds the room's boards at addresses such as
    `sim://room/relays`, and the room's clock runs.

    Parameters
    ----------
    content
        Content of the rig file's `simulation:`, as YAML loads it.
    source
        Path of the rig file, for messages.
    not_before_s
        Earliest epoch of the room in seconds since 1970. A room whose epoch is earlier is opened at
        this time, and its faults keep their times on the wall clock.

    Yields
    ------
    OpenRoom
        The room with its clock, its boards and its camera.

    Raises
    ------
    UsageError
        The description does not fit the model `Simulation`.

    Examples
    --------
    >>> from labrig.sim import open_room
    >>> description = {"sample": "blue-paint", "faults": [{"lamp_dead": {"at": "5 min"}}]}
    >>> with open_room(description, "my-rig.yaml") as room:
    ...     room.clock.sleep(60.0)
    ...     print(sorted(room.boards), room.clock.now())
    ['arduino', 'changer', 'lcus', 'relays', 'servo'] 60.0
    """
    simulation = validate(content, Simulation, f"{source}, simulation").opened_at(not_before_s)
    clock = RoomClock(
        simulation.wall_at_opening_s,
        given(fault.pc_asleep for fault in simulation.faults),
        given(fault.clock_ahead for fault in simulation.faults),
        given(fault.clock_back for fault in simulation.faults),
    )
    room = OpenRoom(simulation, clock)
    protocol_sim.open_door(NAME, room)
    try:
        yield room
    finally:
        protocol_sim.close_door(NAME)


@dataclass(frozen=True)
class _UnitOutputs:
    """LEDs of the room on the outputs of one DC4100."""

    room: Room
    first_relay: int

    def switch(self, output: int, on: bool) -> None:
        self.room.switch_led(self.first_relay + output, on)

    def dim(self, output: int, fraction: float) -> None:
        self.room.dim_led(self.first_relay + output, fraction)


def _dc4100_units(simulation: Simulation, room: Room) -> dict[str, Dc4100Board]:
    """Return the Thorlabs units that switch the LEDs, by their addresses; none if they do not."""
    if simulation.led_board != "dc4100":
        return {}
    units = {}
    for unit in range(DC4100_UNITS):
        first_relay = 1 + OUTPUTS * unit
        heads_nm = {
            led.relay - first_relay: led.centre
            for led in simulation.leds
            if first_relay <= led.relay < first_relay + OUTPUTS
        }
        units[f"dc4100-{unit + 1}"] = Dc4100Board(
            _UnitOutputs(room, first_relay), heads_nm, f"M0010000{unit + 1}"
        )
    return units


def _servo_board(simulation: Simulation, clock: VirtualClock) -> MaestroBoard:
    """Return the Maestro, its channels at home: trap door closed, shield open."""
    homes = {}
    if simulation.shield is not None:
        homes[simulation.shield.channel] = simulation.shield.open
    if simulation.door is not None:
        homes[simulation.door.channel] = simulation.door.closed
    board = MaestroBoard(clock, homes, simulation.servo.time_out)
    if simulation.door is not None and simulation.initial.door == "open":
        board.start_at(simulation.door.channel, simulation.door.open)
    return board


def _camera_faults(faults: Sequence[Fault]) -> CameraFaults:
    """Return the faults of the camera; its cable can be pulled once."""
    camera_faults = CameraFaults(
        busy_spans_s=_spans_s(given(fault.camera_busy for fault in faults)),
        full_spans_s=_spans_s(given(fault.camera_full for fault in faults)),
    )
    for out in given(fault.camera_unplugged for fault in faults):
        camera_faults = replace(
            camera_faults,
            unplug_at_s=out.at if out.after_bytes is None else None,
            unplug_after_bytes=out.after_bytes,
            replug_after_s=out.lasting,
        )
    return camera_faults


def _spans_s(spans: Sequence[FaultTime]) -> tuple[tuple[float, float], ...]:
    return tuple((span.at, span.until) for span in spans)
