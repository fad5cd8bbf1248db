"""A sample changer on any board on a serial line, by commands that are in the rig file."""

from collections.abc import Mapping

from pydantic import Field, field_validator

from labrig.acquire import Connections

from .places import BoardSamples, PlacesSettings, different
from .settings import Command, Exchange


class SerialSampleChanger(BoardSamples):
    """A sample changer of a board whose commands are in the rig file.

    Parameters
    ----------
    address
        Serial port of the board.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(PlacesSettings):
        """Keys of a sample changer of any board on a serial line in a rig file.

        Attributes
        ----------
        samples
            Command that turns to each sample, with the answer that confirms that it is in place, by
            the sample's name: `{blue-paint: {send: turn 2, answer: done}}`.
        away
            The same for the place where all samples are in the dark.
        keeps_dark
            Whether samples that are not in place lie in the dark, light-tight, while another one is
            lit and photographed. Only then may one rest while another is measured.
        """

        samples: Mapping[str, Command] = Field(min_length=1)
        away: Command
        keeps_dark: bool = False

        @field_validator("samples")
        @classmethod
        def _different(cls, commands: Mapping[str, Exchange]) -> Mapping[str, Exchange]:
            return different(commands, "sample")

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(address, settings, connections, settings.samples, settings.away)
        self._keeps_dark = settings.keeps_dark
