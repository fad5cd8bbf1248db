"""Manual settings of the simulated camera's body: `simulation.camera` of a rig file."""

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS

from . import codes

_CUSTOM_FUNCTIONS = ("long_exposure_noise_reduction", "highlight_tone_priority", "mirror_lock_up")


def _on_the_dial(iso: object) -> object:
    if iso not in ("auto", *codes.ISO_LABELS):
        raise ValueError(f"expected 'auto' or 100 to 6400 in thirds of a stop, got {iso!r}")
    return iso


class BodySettings(FrozenModel):
    """Dial, lens switch and menus of the simulated camera; by default set for photometry.

    Attributes
    ----------
    body
        Kind of the camera: `eos`, a Canon EOS, or `standard`, one that has the PTP standard only.
    exposure_mode
        Position of the mode dial; protocols need `M`.
    autofocus
        Whether the lens's switch is at autofocus.
    iso
        ISO sensitivity that is set on the camera when labrig connects, 100 to 6400 in thirds of a
        stop, or `auto`.
    auto_power_off
        Time without a command from the host after which the camera switches itself off, for example
        `1 min`; `0 s`: never.
    long_exposure_noise_reduction
        Whether the EOS's custom function of this name is on. It is reported; its effect is not
        simulated.
    highlight_tone_priority
        Whether the EOS's custom function of this name is on. It is reported; its effect is not
        simulated.
    mirror_lock_up
        Whether the EOS's custom function of this name is on. It is reported; its effect is not
        simulated.
    """

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
