"""A home-made sample changer on a servo."""

from collections.abc import Mapping
from typing import Self

from pydantic import Field, model_validator

from labrig.acquire import Connections

from .places import ServoSamples, require_different
from .servo import PulseS, ServoSettings


class MaestroSampleChanger(ServoSamples):
    """Samples on a disk or a slide that a servo on a Pololu Maestro moves.

    Parameters
    ----------
    address
        The Maestro's command port; other channels of it may be used by other devices.
    settings
        The rig file's keys for this device.
    connections
        Connections that open the port.
    """

    class Settings(ServoSettings):
        """Keys of a sample changer on a servo in a rig file.

        Attributes
        ----------
        samples
            Length of the servo's pulse with each sample in place, by the sample's name, for example
            `{blue-paint: 1100 us, green-paint: 1300 us}`.
        away
            Length of the servo's pulse with all samples in the dark, for example `1000 us`.
        keeps_dark
            Whether samples that are not in place lie in the dark, light-tight, while another one is
            lit and photographed. Only then may one rest while another is measured.
        """

        samples: Mapping[str, PulseS] = Field(min_length=1)
        away: PulseS
        keeps_dark: bool = False

        @model_validator(mode="after")
        def _different_pulses(self) -> Self:
            require_different(self.samples, self.away, "sample and for 'away'")
            return self

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        super().__init__(address, settings, connections, settings.samples, settings.away)
        self._keeps_dark = settings.keeps_dark
