"""Banks of lights of which at most one is lit: LEDs, and broadband lamps.

LEDs are narrow bands of light that charge the sample; under broadband lamps, the illuminants, it is
seen as in daily life. Both are one kind of device under two keys of a rig file.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar, Protocol, runtime_checkable

from pydantic import BaseModel, BeforeValidator, Field, create_model

from labrig.acquire.channels import Board, Switch
from labrig.acquire.connections import Connections
from labrig.acquire.roles.board_device import (
    BoardDevice,
    keys_model,
    read_back_findings,
    require_distinct,
)
from labrig.acquire.roles.known_light import Illuminant, LedLight
from labrig.acquire.roles.role import (
    DARK,
    ExerciseContext,
    Exercised,
    Finding,
    Light,
    Measured,
    PlannedDevice,
    Role,
    spread_ms,
)
from labrig.foundation.errors import DeviceError, ProtocolError
from labrig.foundation.quantity import duration_text

#: Differences of a head's own wavelength from the rig file's peak, in nm, that are worth a
#: warning, and that mean another head than was meant.
NOTABLE_NM, OTHER_HEAD_NM = 5.0, 20.0


@runtime_checkable
class LightBank(Light, Protocol):
    """Lights of which at most one is on. Safe state: all off."""

    def channels(self) -> tuple[str, ...]:
        """Return the names of the lights."""

    def settling_s(self, channel: str, /) -> float:
        """Return the time in seconds from switching a light on until it is steady."""

    def light(self, channel: str, /) -> None:
        """Switch one light on after all others are off; both are read back where the device can.

        It is steady `settling_s` later, for which protocols wait themselves.
        """

    def dark(self) -> None:
        """Switch all lights off, read back where the device can."""

    def channel_on(self) -> str | None:
        """Return the light that is on, None if all are off: as read back where the device can.

        Raises
        ------
        DeviceError
            If more than one light is on.
        """


class PlannedLightBank(PlannedDevice):
    """Stand-in of a bank of lights in a plan; protocols wait for a light's settling themselves.

    Files of spectra are read, so that a missing one is found before anything moves.
    """

    def __init__(self, lights: Mapping[str, LedLight]) -> None:
        for light in lights.values():
            light.relative_spectrum()
        self._lights = dict(lights)
        self._channel_on: str | None = None

    def reads_back(self) -> bool:
        """Return False: nothing else can switch a stand-in."""
        return False

    def channels(self) -> tuple[str, ...]:
        """Return the names in the rig file."""
        return tuple(self._lights)

    def settling_s(self, channel: str, /) -> float:
        """Return the settling time in seconds in the rig file."""
        return self._lights[channel].settling

    def light(self, channel: str, /) -> None:
        """Switch one light on."""
        self._channel_on = channel

    def dark(self) -> None:
        """Switch all lights off."""
        self._channel_on = None

    def channel_on(self) -> str | None:
        """Return the light that is on, as commanded last."""
        return self._channel_on


class SwitchedLights(BoardDevice):
    """Lights on switches of one board, or of several of a kind, at most one lit at a time.

    Two lights are never lit together: all that may be lit are switched off and, where the board
    can, read back before another one is switched on.

    Raises
    ------
    DeviceError
        Another device is at an address, or a light's own wavelength contradicts the rig file.
    """

    kind = Switch
    #: Names of one light and of all in messages, and model of a light's keys.
    each: ClassVar[str]
    noun: ClassVar[str]
    light_class: ClassVar[type[LedLight]]

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        self._lights: Mapping[str, Any] = settings.channels
        addresses = dict.fromkeys(
            [address, *(light.address or address for light in self._lights.values())]
        )
        self.board_class.check_addresses(settings, addresses)
        self._boards: dict[str, Board] = {}
        self._switches: dict[str, Switch] = {}
        try:
            for port in addresses:
                board = self._boards[port] = self.board_class(port, settings, connections)
                for name, light in self._lights.items():
                    if (light.address or address) == port:
                        self._switches[name] = self.channel_class(board, light)
        except BaseException:  # what a crash left lit on other boards is not to stay so
            with suppress(DeviceError), connections.clock.shielded():
                self.make_safe()
            raise
        self._switches = {name: self._switches[name] for name in self._lights}
        self._require_heads()

    @classmethod
    def keys(cls, board: type[Board], channel: type[Switch]) -> type[BaseModel]:
        """Return the model of the device's keys: `channels`, and those of the board."""
        one = create_model(
            f"{board.__name__} {cls.each}",
            __base__=(cls.light_class, channel.Settings),
            __doc__=f"Channel and light of one {cls.each}.",
            address=(
                Annotated[str, Field(min_length=1)] | None,
                Field(None, description="Address of the board, if it is another one."),
            ),
        )

        def differ(settings: Any) -> None:
            require_distinct(
                ((light.address, channel.distinct(light)) for light in settings.channels.values()),
                f"a {channel.noun} of its own for each {cls.each} in 'channels'",
            )

        return keys_model(
            cls,
            (board.Settings,),
            differ,
            channels=(
                dict[Annotated[str, Field(min_length=1)], _or_its_only_key(one, channel)],  # type: ignore[misc]
                Field(
                    min_length=1,
                    description=f"Channel and light of each {cls.each} by the {cls.each}'s name.",
                ),
            ),
        )

    def reads_back(self) -> bool:
        """Return whether the states of all lights are reported by their boards."""
        return all(switch.reads_back() for switch in self._switches.values())

    def identity(self) -> str:
        """Return the identity of every board with the lights on it."""
        return "; ".join(
            f"{board.identity()}, {self.noun} "
            + ", ".join(
                f"{name} on {switch.identity()}" if switch.place() else name
                for name, switch in switches.items()
            )
            for board, switches in self._by_board()
        )

    def findings(self) -> Sequence[Finding]:
        """Return whether heads contradict the rig file, else whether lights are read back."""
        return [
            Finding(
                "warn",
                f"the head of {name} says {head_nm:g} nm, the rig file's peak is {peak_nm:g} nm",
                "measure its spectrum, and name the file as 'spectrum'",
            )
            for name, head_nm, peak_nm in self._wavelengths_nm()
            if abs(head_nm - peak_nm) > NOTABLE_NM
        ] or read_back_findings(list(self._switches.values()))

    @classmethod
    def outlets(cls, address: str, settings: Any) -> list[tuple[str, Hashable]]:
        """Return what each light occupies: the address of its board, and what of it."""
        return [
            (light.address or address, cls.channel_class.outlet(light))
            for light in settings.channels.values()
        ]

    def channels(self) -> tuple[str, ...]:
        """Return the names of the lights, in the rig file's order."""
        return tuple(self._switches)

    def settling_s(self, channel: str, /) -> float:
        """Return the time in seconds from switching a light on until it is steady."""
        settling_s: float = self._lights[channel].settling
        return settling_s

    def light(self, channel: str, /) -> None:
        """Switch off all lights that may be lit, then switch on one; read back where possible."""
        self.dark()
        self._switches[channel].switch(on=True)

    def dark(self) -> None:
        """Switch off all lights that may be lit, each even if another one fails."""
        Board.switch_off([each for each in self._switches.values() if each.state is not False])

    def channel_on(self) -> str | None:
        """Return the light that is on, as reported by the board, else as commanded last.

        Raises
        ------
        DeviceError
            Several lights are on.
        """
        names = [
            name
            for board, switches in self._by_board()
            for name, is_on in zip(switches, board.are_on(list(switches.values())), strict=True)
            if is_on
        ]
        if len(names) > 1:
            boards = " and ".join(board.name for board in self._boards.values())
            raise DeviceError(
                f"{boards}: {' and '.join(names)} are lit at once; something else has switched "
                "them: leave the board to labrig while it measures"
            )
        return names[0] if names else None

    def heartbeat(self) -> None:
        """Restart the watchdogs of the boards that have one."""
        for board in self._boards.values():
            board.heartbeat()

    def make_safe(self) -> None:
        """Switch all lights off, whatever was interrupted, on each board even if another fails."""
        failure: DeviceError | None = None
        for board, switches in self._by_board():
            try:
                board.make_safe(list(switches.values()))
            except DeviceError as error:
                failure = failure or error
        if failure:
            raise failure

    def _by_board(self) -> Iterator[tuple[Board, dict[str, Switch]]]:
        """Yield every board with the lights on it by their names."""
        for board in self._boards.values():
            on_board = {name: each for name, each in self._switches.items() if each.board is board}
            yield board, on_board

    def _require_heads(self) -> None:
        for name, head_nm, peak_nm in self._wavelengths_nm():
            if abs(head_nm - peak_nm) > OTHER_HEAD_NM:
                raise DeviceError(
                    f"the head on {self._switches[name].name} is one of {head_nm:g} nm, the "
                    f"{self.each} '{name}' of the rig file has its peak at {peak_nm:g} nm; plug "
                    "the heads in as in the rig file, or correct that"
                )

    def _wavelengths_nm(self) -> Iterator[tuple[str, float, float]]:
        """Yield name, head's wavelength and rig file's peak of lights of which both are known."""
        for name, switch in self._switches.items():
            head_nm = switch.head_nm()
            if head_nm is not None and (peak_nm := self._lights[name].peak_nm()) is not None:
                yield name, head_nm, peak_nm


def _or_its_only_key(model: type[BaseModel], channel: type[Switch]) -> Any:
    """Return the type of a light's keys; where a channel has a single key, its value will do."""
    if len(channel.Settings.model_fields) != 1:
        return model
    ((key, field),) = channel.Settings.model_fields.items()
    number = Annotated[field.annotation, *field.metadata]  # type: ignore[name-defined]

    def with_key(value: Any) -> Any:
        return value if isinstance(value, dict | BaseModel) else {key: value}

    return Annotated[model, BeforeValidator(with_key, json_schema_input_type=number | model)]


class SwitchedLeds(SwitchedLights):
    """LEDs on switches of a board."""

    each, noun = "LED", "LEDs"
    light_class = LedLight


class SwitchedLamps(SwitchedLights):
    """Broadband lamps on switches of a board."""

    each, noun = "lamp", "lamps"
    light_class = Illuminant


@dataclass(frozen=True)
class BankSwitch:
    """An action that switches one light of a bank on and all others off.

    Attributes
    ----------
    channel
        Name of the light; None to switch all off.
    """

    channel: str | None
    #: Key of the role, what one of its lights is called, and the key of protocols that names some.
    device: ClassVar[str]
    noun: ClassVar[str]
    protocol_key: ClassVar[str]

    def __str__(self) -> str:
        return DARK if self.channel is None else f"{self.channel} on"

    def begin(self, bank: LightBank) -> None:
        """Switch the lights.

        Raises
        ------
        ProtocolError
            If there is no such light.
        """
        if self.channel is None:
            bank.dark()
        elif self.channel in bank.channels():
            bank.light(self.channel)
        else:
            raise ProtocolError(
                f"the protocol lights {self.noun} '{self.channel}', which the rig has not: it has "
                f"{', '.join(bank.channels())}; name one of these in '{self.protocol_key}:'"
            )


def _exercise(bank: LightBank, context: ExerciseContext, *, nouns: str) -> Exercised:
    """Switch each light on for some hundredths of a second, once: arcs do not like it.

    `nouns` is what the lights are called in messages.
    """
    measured, off_s = [], []
    try:
        for channel in bank.channels():
            on_s = context.timed_s(partial(bank.light, channel))
            measured.append(Measured(f"{channel} on, read back", f"{on_s * 1e3:.1f} ms"))
            if settling_s := bank.settling_s(channel):
                text = f"{duration_text(settling_s)}, for which protocols wait"
                measured.append(Measured(f"{channel} settles, from the rig file", text))
            _require_state(bank, channel, nouns)
            off_s.append(context.timed_s(bank.dark))
            _require_state(bank, None, nouns)
    finally:
        with context.clock.shielded():
            bank.dark()
    return Exercised((*measured, Measured("off, read back", spread_ms(off_s))))


def _require_state(bank: LightBank, channel: str | None, nouns: str) -> None:
    if (channel_on := bank.channel_on()) != channel:
        raise DeviceError(
            f"the {nouns} were switched to {channel or 'dark'}, they say {channel_on or 'dark'}; "
            "look at them, switch them off by hand and check the relays"
        )


class LedSwitch(BankSwitch):
    """The action that switches one LED on and all others off, or all off for None."""

    device = "leds"
    noun = "an LED"
    protocol_key = "leds"


class IlluminantSwitch(BankSwitch):
    """The action that switches one lamp of the bank on and all others off, or all off for None."""

    device = "illuminants"
    noun = "a lamp"
    protocol_key = "lamps"


LEDS_OFF = LedSwitch(None)
ILLUMINANTS_OFF = IlluminantSwitch(None)


def _role(name: str, switch: type[BankSwitch], on_board: type[SwitchedLights]) -> Role[LightBank]:
    return Role(
        key=switch.device,
        protocol_class=LightBank,
        name=name,
        planned=lambda settings, clock: PlannedLightBank(settings.channels),
        on_board=on_board,
        exercise=partial(_exercise, nouns=on_board.noun),
        state=lambda bank: str(switch(bank.channel_on())),
        safe_first=True,
    )


#: Narrow-band LEDs that charge the sample, and broadband lamps under which it is seen daily.
LEDS = _role("bank of LEDs", LedSwitch, SwitchedLeds)
ILLUMINANTS = _role("bank of lamps", IlluminantSwitch, SwitchedLamps)
