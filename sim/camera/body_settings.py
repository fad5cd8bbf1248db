"""What somebody has set on the simulated camera's body by hand: `simulation.camera` of a rig."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from labrig.quantity import DurationS

from . import codes

_CUSTOM_FUNCTIONS = ("long_exposure_noise_reduction", "highlight_tone_priority", "mirror_lock_up")


def _on_the_dial(iso: object) -> object:
    if iso not in ("auto", *codes.ISO_LABELS):
        raise ValueError(f"expected 'auto' or 100 to 6400 in thirds of a stop, got {iso!r}")
    return iso


class BodySettings(BaseModel):
    """Dial, lens switch and menus; as a careful person sets them for photometry.

    Attributes
    ----------
    body
        Which camera it is: a Canon EOS, or one that knows nothing but the PTP standard.
    exposure_mode
        Where the dial stands.
    autofocus
        The switch on the lens.
    iso
        As the dial says it.
    auto_power_off
        Without a word from the host for so long, the camera switches itself off; 0: never.
    long_exposure_noise_reduction, highlight_tone_priority, mirror_lock_up
        Custom functions of an EOS; only reported, their effect is not simulated.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    body: Literal["eos", "standard"] = "eos"
    exposure_mode: Literal["P", "Tv", "Av", "M", "B"] = "M"
    autofocus: bool = False
    iso: Annotated[Literal["auto"] | int, BeforeValidator(_on_the_dial)] = 100
    auto_power_off: Annotated[DurationS, Field(ge=0)] = 0.0
    long_exposure_noise_reduction: bool = False
    highlight_tone_priority: bool = False
    mirror_lock_up: bool = False

    @model_validator(mode="after")
    def _functions_of_an_eos(self) -> Self:
        switched_on = [name for name in _CUSTOM_FUNCTIONS if getattr(self, name)]
        if self.body != "eos" and switched_on:
            raise ValueError(f"expected 'body: eos' with {', '.join(switched_on)}")
        return self
