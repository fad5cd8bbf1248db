"""Devices that are channels of a board: how a role and a board's driver make one."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import cache
from typing import Any, ClassVar

from pydantic import BaseModel, create_model, model_validator

from labrig.acquire.channels import Board, Channel, Switch
from labrig.acquire.connections import Connections
from labrig.acquire.roles.role import Finding


class BoardDevice:
    """Base of the devices that fill a role by channels of a board.

    A role derives from it once; `for_board` gives the class for one board, which is used like any
    driver.

    Parameters
    ----------
    address
        Address of the board; other channels of it may be used by other devices.
    settings
        The rig file's keys for this device, of the class `Settings`.
    connections
        Connections that open the port.
    """

    #: Kind of channel that the role takes, and name of the device in messages.
    kind: ClassVar[type[Channel]]
    noun: ClassVar[str]
    #: Classes of the board and of its channel, and of the keys in a rig file.
    board_class: ClassVar[type[Board]]
    channel_class: ClassVar[type[Any]]
    Settings: ClassVar[type[BaseModel]]

    def __init__(self, address: str, settings: Any, connections: Connections) -> None:
        self.settings = settings
        self.board = self.board_class(address, settings, connections)

    @classmethod
    def keys(cls, board: type[Board], channel: type[Any]) -> type[BaseModel]:
        """Return the model of the device's keys: those of board and channel."""
        return keys_model(cls, (channel.Settings, board.Settings))

    @classmethod
    def outlets(cls, address: str, settings: Any) -> list[tuple[str, Hashable]]:
        """Return what the device occupies: the address of each board, and what of it."""
        return [(address, cls.channel_class.outlet(settings))]

    @classmethod
    @cache
    def for_board(cls, board: type[Board]) -> "type[BoardDevice] | None":
        """Return the class of the device on a board, None if the board has no such channel."""
        for channel in board.channels:
            if issubclass(channel, cls.kind):
                return type(
                    f"{board.__name__}{cls.__name__}",
                    (cls,),
                    {
                        "__doc__": cls.__doc__,
                        "board_class": board,
                        "channel_class": channel,
                        "Settings": cls.keys(board, channel),
                    },
                )
        return None

    def heartbeat(self) -> None:
        """Restart the board's watchdog, if it has one."""
        self.board.heartbeat()

    def disconnect(self) -> None:
        """Do nothing: the port belongs to the connections, which close it."""


def keys_model(
    device: type[BoardDevice],
    parts: Iterable[type[BaseModel]],
    check: Callable[[Any], None] | None = None,
    **keys: Any,
) -> type[BaseModel]:
    """Return the model of a device's keys.

    Parameters
    ----------
    device
        Class of the device.
    parts
        Models whose keys it has.
    check
        Function that raises ValueError for keys that contradict each other.
    keys
        Further keys, each with its type and its default or `Field`.
    """

    def checked(settings: Any) -> Any:
        if check is not None:
            check(settings)
        return settings

    validators: dict[str, Any] = {"checked": model_validator(mode="after")(checked)}
    model: type[BaseModel] = create_model(
        "Settings",
        __base__=tuple(parts),
        __doc__=device.__doc__,
        __validators__=validators,
        **keys,
    )
    return model


def require_distinct(places: Iterable[Hashable], expected: str) -> None:
    """Refuse channels or positions of which two are the same.

    Raises
    ------
    ValueError
        They are; the message ends with what is `expected`.
    """
    places = list(places)
    if len(set(places)) < len(places):
        raise ValueError(f"expected {expected}")


def read_back_findings(switches: Sequence[Switch]) -> list[Finding]:
    """Return whether anything but the camera can verify that lights were switched."""
    if all(switch.reads_back() for switch in switches):
        return [Finding("fine", "the board reports its states: they are read back")]
    behaviour = (
        "this board confirms commands and does not report its state"
        if all(switch.acknowledges() for switch in switches)
        else "this board never acknowledges"
    )
    return [
        Finding(
            "warn",
            f"{behaviour}: a relay that does not switch goes unnoticed here",
            "see the light flash now; in a run only the camera can show it, so keep photographs "
            "under the lamp and after it (protocol 'decay' takes them), and if the board has a "
            "query for its state, use a driver that reads it, such as serial_relay with 'state'",
        )
    ]
