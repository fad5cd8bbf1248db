"""Lights that excite a sample one after another: filters, a monochromator, narrow LEDs."""

from enum import StrEnum
from typing import Annotated, Self

from pydantic import Field, model_validator

from labrig.acquire import LAMP_OFF, LAMP_ON, LEDS_OFF, LampSwitch, LedSwitch
from labrig.foundation.models import FrozenModel

from .bench_configuration import BenchConfiguration, Stage

Nanometres = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class CardSpectra(StrEnum):
    """Roles of a spectrometer's readings of the card under the same lights."""

    DIRECT = "spectrum-direct"
    LIGHT = "spectrum-light"
    DARK = "spectrum-dark"


class ExcitingLights(FrozenModel):
    """Lights that are selected one after another, in one of three ways.

    Attributes
    ----------
    filters
        Colour filters before the lamp, by their names in the rig's folder of filters, for example
        `[bandpass-450, bandpass-500]`. A filter wheel puts those before the lamp that it has, a
        person all others.
    monochromator
        Wavelengths in nm to which the monochromator before the lamp is tuned, for example
        `[420, 450, 480]`.
    leds
        LEDs of the rig's bank, which shine in place of the lamp, for example `[450 nm, 525 nm]`.
    """

    filters: tuple[str, ...] = ()
    monochromator: tuple[Nanometres, ...] = ()
    leds: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        given = [
            name for name in ("filters", "monochromator", "leds") if len(getattr(self, name)) > 0
        ]
        if len(given) != 1:
            raise ValueError(
                "expected lights of one kind, 'filters', 'monochromator' or 'leds', got "
                f"{' and '.join(given) or 'none'}"
            )
        names = self.names()
        if len(set(names)) < len(names):
            raise ValueError(f"expected every light once, got {', '.join(names)}")
        return self

    def names(self) -> tuple[str, ...]:
        """Return the names of the lights in order."""
        tuned = tuple(f"{wavelength_nm:g} nm" for wavelength_nm in self.monochromator)
        return self.filters or self.leds or tuned

    def configuration(self, name: str, stage: Stage = "sample") -> BenchConfiguration:
        """Return the configuration of the bench for one light."""
        if self.filters:
            return BenchConfiguration(stage, filter=name)
        if self.monochromator:
            wavelength_nm = self.monochromator[self.names().index(name)]
            return BenchConfiguration(stage, monochromator_nm=wavelength_nm)
        return BenchConfiguration(stage)

    def on(self, name: str) -> LampSwitch | LedSwitch:
        """Return the action that switches the light on."""
        return LedSwitch(name) if self.leds else LAMP_ON

    @property
    def off(self) -> LampSwitch | LedSwitch:
        """Action that switches any of the lights off."""
        return LEDS_OFF if self.leds else LAMP_OFF


def light_unit(name: str, number: int) -> str:
    """Return the name of the unit that photographs the card under a selected light."""
    return f"light-{name}-{number}"
