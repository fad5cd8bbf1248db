"""Settings of the kinetics of a real phosphor: `kinetics` of a simulated sample."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from labrig.foundation.quantity import Fraction

from .bench_settings import Part

#: Depth of the traps of which nothing else is said, in eV.
USUAL_DEPTH_EV = 0.65

#: Keys that only some of the models have.
MODELS_OF_KEYS = {
    "retrapping": ("otor", "trap_depths"),
    "order": ("general_order",),
    "prompt": ("first_order", "general_order"),
    "charging_offset": ("first_order", "general_order"),
    "shape": ("trap_depths",),
    "width_ev": ("trap_depths",),
    "frequency_per_s": ("trap_depths",),
}


class KineticsSettings(Part):
    """Law by which the traps of a sample fill and empty, where it is not of first order.

    The material's rates stay what they are: the excitation rates generate charge carriers at the
    surface of the sample, and a full trap is emptied at the re-radiation rate, at 21 °C. Each
    carrier that recombines gives the light that Λ says.

    Attributes
    ----------
    model
        Law of the traps. `first_order`: as of any sample, or of the kinetic order in its material's
        file. `general_order`: the re-radiation is k_r
        times the concentration to the power `order`. `otor`: one trap and one recombination centre,
        between which free carriers choose. `trap_depths`: traps of many depths, each of first
        order, or with `retrapping` into its own depth.
    retrapping
        Probability that an empty trap takes a free carrier, over that of a recombination centre;
        `otor` needs it. 1 gives a decay of second order, very little one of first order.
    order
        Kinetic order.
    prompt
        Fraction of the carriers that find their trap filled and recombine at once, which lights up
        the sample as long as the lamp shines.
    charging_offset
        Makes charging convex: a sample of concentration r takes (`charging_offset` + r) /
        (`charging_offset` + 1/2) times the carriers, for example 0.3. Null: it does not.
    depth_ev
        Depth of the traps in eV, which says how the temperature changes the re-radiation; of a
        distribution the middle if it is `gaussian`, the least depth if it is `exponential`.
    shape
        Distribution of the depths: `gaussian`, or `exponential`, rarer by a factor e for each
        `width_ev` more.
    width_ev
        Width of that distribution in eV: 1 σ, or the depth for a factor e.
    frequency_per_s
        Frequency factor: a trap of depth E is emptied at this rate times exp(−E/kT). Null: the
        traps of `depth_ev` are emptied at the material's re-radiation rate.
    optical_density
        Optical density of the whole sample, decadic, where it absorbs exciting light most; at other
        wavelengths it is as much less as the excitation rates are. The light gets weaker on its way
        down, and all depths glow alike.
    self_excitation
        Carriers that the sample's own glow generates for each one that recombines, as if so much of
        the light were absorbed again on its way out; Λ is of the light that leaves.
    excitation
        Shape of the excitation spectrum within the material's bands: `steps`, the same in all of a
        band, or `smooth`, with the bands' means.
    excitation_beyond
        Excitation rates below the first and above the last band, down to 300 nm and up to 780 nm,
        as a fraction of those of these bands.
    """

    model: Literal["first_order", "general_order", "otor", "trap_depths"] = "first_order"
    retrapping: Annotated[float, Field(ge=1e-6, le=100)] | None = None
    order: Annotated[float, Field(ge=1, le=4)] = 2.0
    prompt: Annotated[Fraction, Field(ge=0, le=1)] = 0.0
    charging_offset: Annotated[float, Field(gt=0, le=100)] | None = None
    depth_ev: Annotated[float, Field(gt=0, le=3)] = USUAL_DEPTH_EV
    shape: Literal["gaussian", "exponential"] = "gaussian"
    width_ev: Annotated[float, Field(gt=0, le=0.3)] = 0.05
    frequency_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    optical_density: Annotated[float, Field(ge=0, le=6)] = 0.0
    self_excitation: Annotated[Fraction, Field(ge=0, le=0.5)] = 0.0
    excitation: Literal["steps", "smooth"] = "steps"
    excitation_beyond: Annotated[Fraction, Field(ge=0, le=10)] = 0.0

    @model_validator(mode="after")
    def _keys_of_the_model(self) -> Self:
        for key in sorted(self.model_fields_set & MODELS_OF_KEYS.keys()):
            if self.model not in MODELS_OF_KEYS[key]:
                raise ValueError(
                    f"expected '{key}' with 'model: {' or '.join(MODELS_OF_KEYS[key])}' only, got "
                    f"it with '{self.model}'"
                )
        if self.model == "otor" and self.retrapping is None:
            raise ValueError("expected 'retrapping' with 'model: otor', for example 0.1")
        return self
