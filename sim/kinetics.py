"""Laws by which traps fill and empty, and the traps of which a sample consists.

A law gives the growth dn/dt of the filled fraction n of traps that are emptied at a rate p while
carriers are generated at a rate f, and the rate of emission. It is integrated as it stands by
`traps`; neither its solution nor one of the fits' formulae is used.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from labrig.foundation.arrays import FloatArray
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


#: Boltzmann's constant in eV/K.
BOLTZMANN_EV_K = 8.617333e-5
#: Temperature in K to which a material's rates belong.
RATES_K = 294.15

#: Depths of neighbouring traps differ by this at most, in eV: a factor e of their rates, which
#: leaves a ripple below 0.1 % on their common decay.
DEPTH_STEP_EV = 0.025
#: How far a distribution of depths is followed, in its widths: 1 in 10⁵ is beyond.
GAUSSIAN_WIDTHS, EXPONENTIAL_WIDTHS = 4.5, 12.0
#: Layers of a sample: some, and so many more for each unit of its optical density.
LAYERS, LAYERS_PER_DENSITY = 4, 2


class Rates(NamedTuple):
    """Rates of filling, emptying and emission of traps.

    Attributes
    ----------
    growth
        dn/dt.
    slope
        Derivative of the growth by n.
    emission
        Carriers that recombine, as a fraction of all traps.
    """

    growth: FloatArray
    slope: FloatArray
    emission: FloatArray


class Law(Protocol):
    """Law of traps; arrays of any shape."""

    def rates(self, n: FloatArray, f: FloatArray, p: FloatArray) -> Rates:
        """Return the rates of traps of which n, 0 to 1, are filled."""

    def generation(self, n: float, p: float) -> float:
        """Return the generation rate that keeps n of the traps filled."""


@dataclass(frozen=True)
class GeneralOrder:
    """Kinetics of order b: dn/dt = (1 − n) f c(n) − p nᵇ, with c(n) = (o + n)/(o + 1/2).

    C. E. May and J. A. Partridge, J. Chem. Phys. 40 (1964) 1401. The emission is p nᵇ + η f c n.

    Attributes
    ----------
    order
        b.
    prompt
        η, fraction of the carriers that recombine at once where their trap is filled.
    charging_offset
        o; infinite for c = 1.
    """

    order: float
    prompt: float = 0.0
    charging_offset: float = math.inf

    def rates(self, n: FloatArray, f: FloatArray, p: FloatArray) -> Rates:
        """Return the rates; see `Law`."""
        ease, easier = self._ease(n)
        escape = p * n**self.order
        return Rates(
            growth=f * (1 - n) * ease - escape,
            slope=f * ((1 - n) * easier - ease) - p * self.order * n ** (self.order - 1),
            emission=escape + self.prompt * f * ease * n,
        )

    def generation(self, n: float, p: float) -> float:
        """Return the generation rate that keeps n of the traps filled."""
        ease, _ = self._ease(np.asarray(n))
        return float(p * n**self.order / ((1 - n) * ease))

    def _ease(self, n: FloatArray) -> tuple[FloatArray, float]:
        """Return c(n) and its derivative."""
        if math.isinf(self.charging_offset):
            return np.ones_like(n), 0.0
        scale = self.charging_offset + 0.5
        return (self.charging_offset + n) / scale, 1 / scale


@dataclass(frozen=True)
class OneTrap:
    """One trap, one recombination centre (OTOR), free carriers in quasi-equilibrium.

    A free carrier is trapped with the probability q = R (1 − n)/(R (1 − n) + n), so that dn/dt =
    (f + p n) q − p n, and the emission is (f + p n)(1 − q). J. T. Randall and M. H. F. Wilkins,
    Proc. R. Soc. A 184 (1945) 366; G. F. J. Garlick and A. F. Gibson, Proc. Phys. Soc. 60 (1948)
    574.

    Attributes
    ----------
    retrapping
        R.
    """

    retrapping: float

    def rates(self, n: FloatArray, f: FloatArray, p: FloatArray) -> Rates:
        """Return the rates; see `Law`."""
        empty = self.retrapping * (1 - n)
        places = empty + n
        free = f + p * n
        return Rates(
            growth=(f * empty - p * n**2) / places,
            slope=(p * empty - free * self.retrapping / places) / places - p,
            emission=free * n / places,
        )

    def generation(self, n: float, p: float) -> float:
        """Return the generation rate that keeps n of the traps filled."""
        return p * n**2 / (self.retrapping * (1 - n))


@dataclass(frozen=True)
class SelfExcited:
    """Traps of another law whose own glow generates carriers, too: f + s e, e the emission.

    Attributes
    ----------
    law
        Law of the traps; emission and growth are linear in f.
    share
        s, below 1: carriers that are generated for each one that recombines.
    """

    law: Law
    share: float

    def rates(self, n: FloatArray, f: FloatArray, p: FloatArray) -> Rates:
        """Return the rates; see `Law`. The slope is that of a glow which does not change with n."""
        without = self.law.rates(n, f, p).emission
        by_light = self.law.rates(n, f + 1, p).emission - without
        emission = without / (1 - self.share * by_light)
        return self.law.rates(n, f + self.share * emission, p)

    def generation(self, n: float, p: float) -> float:
        """Return the generation rate that keeps n of the traps filled, without the glow's part."""
        whole = self.law.generation(n, p)
        emission = self.law.rates(np.array(n), np.array(whole), np.array(p)).emission
        return whole - self.share * float(emission)


@dataclass(frozen=True)
class Traps:
    """The traps of which the states of samples consist, arrays of shape (traps,).

    Attributes
    ----------
    law
        Index of the law among `laws`; −1: the rate equation of first order, with traps of the usual
        depth.
    activation
        Depth of the traps over the usual one.
    share
        Fraction of their state that the traps are.
    state
        Index of their state among those of all materials.
    laws
        All laws.
    """

    law: NDArray[np.intp]
    activation: FloatArray
    share: FloatArray
    state: NDArray[np.intp]
    laws: tuple[Law, ...]

    def of(self, index: NDArray[np.intp]) -> "Traps":
        """Return some of the traps, in the order of `index`."""
        return Traps(
            self.law[index], self.activation[index], self.share[index], self.state[index], self.laws
        )

    def relative_emission(self, n: FloatArray, k_r_per_s: FloatArray, faster: float) -> FloatArray:
        """Return the emission in the dark of traps with a law over `faster` × `k_r_per_s`; else n.

        Parameters
        ----------
        n, k_r_per_s : ndarray, shape (traps,)
            Filled fractions, and rates at 21 °C.
        faster
            Factor of the temperature on the rates of traps of the usual depth.
        """
        relative = n.copy()
        for number, law in enumerate(self.laws):
            own = np.flatnonzero(self.law == number)
            escape = k_r_per_s[own] * faster ** self.activation[own]
            emission = law.rates(n[own], np.zeros_like(escape), escape).emission
            relative[own] = emission / (faster * k_r_per_s[own])
        return relative


def law_of(settings: KineticsSettings | None, order: float = 1.0) -> Law | None:
    """Return the law of a state; None if it is the rate equation with traps of usual depth.

    Parameters
    ----------
    settings
        Settings of the sample.
    order
        Kinetic order of the state in the material's file, which settings of a law of their own
        leave at 1.
    """
    if settings is not None and settings.self_excitation:
        law = _law_without_own_glow(settings, order) or GeneralOrder(1.0)
        return SelfExcited(law, settings.self_excitation)
    return _law_without_own_glow(settings, order)


def _law_without_own_glow(settings: KineticsSettings | None, order: float) -> Law | None:
    """Return the law of a state that does not take up its own glow."""
    if settings is None:
        return None if order == 1 else GeneralOrder(order)
    if settings.retrapping is not None:
        return OneTrap(settings.retrapping)
    offset = math.inf if settings.charging_offset is None else settings.charging_offset
    own_order = settings.order if settings.model == "general_order" else order
    law = GeneralOrder(own_order, settings.prompt, offset)
    is_plain = law == GeneralOrder(1.0) and settings.depth_ev == USUAL_DEPTH_EV
    return None if is_plain and settings.model != "trap_depths" else law


class Depths(NamedTuple):
    """Distribution of a state's traps, each of shape (depths,).

    Attributes
    ----------
    k_r_per_s
        Rates at which they are emptied at 21 °C.
    activation
        Depths over the usual one.
    share
        Fractions of all traps.
    """

    k_r_per_s: FloatArray
    activation: FloatArray
    share: FloatArray


def depths_of(settings: KineticsSettings | None, k_r_per_s: float) -> Depths:
    """Return the traps of a state with this re-radiation rate in the material's file."""
    if settings is None:
        settings = KineticsSettings()
    middle, width = settings.depth_ev, settings.width_ev
    depth_ev: FloatArray
    share: FloatArray
    if settings.model != "trap_depths":
        return Depths(np.array([k_r_per_s]), np.array([middle / USUAL_DEPTH_EV]), np.ones(1))
    if settings.shape == "gaussian":
        half = GAUSSIAN_WIDTHS * width
        offset_ev = np.linspace(-half, half, 1 + 2 * math.ceil(half / min(DEPTH_STEP_EV, width)))
        depth_ev, share = middle + offset_ev, np.exp(-((offset_ev / width) ** 2) / 2)
    else:
        whole = EXPONENTIAL_WIDTHS * width
        panels = math.ceil(whole / min(DEPTH_STEP_EV, width))
        # Gauss and Legendre's two nodes in each panel, of equal weight.
        nodes = np.arange(panels)[:, None] + np.array([0.5 - 12**-0.5, 0.5 + 12**-0.5])
        offset_ev = whole / panels * nodes.ravel()
        depth_ev, share = middle + offset_ev, np.exp(-offset_ev / width)
    per_depth = 1 / (BOLTZMANN_EV_K * RATES_K)
    rate = np.exp(per_depth * (middle - depth_ev)) * rate_in_the_middle(settings, k_r_per_s)
    return Depths(rate, depth_ev / USUAL_DEPTH_EV, share / share.sum())


def rate_in_the_middle(settings: KineticsSettings, k_r_per_s: float) -> float:
    """Return the rate at 21 °C at which traps of `depth_ev` are emptied."""
    if settings.frequency_per_s is None:
        return k_r_per_s
    return settings.frequency_per_s * math.exp(-settings.depth_ev / (BOLTZMANN_EV_K * RATES_K))


def layers_of(
    settings: KineticsSettings | None, excitation: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the layers of a sample: light in each of them, and its fraction of the thickness.

    Beer and Lambert's law; the layers lie where Gauss and Legendre's quadrature has its nodes.

    Parameters
    ----------
    settings
        Settings of the sample.
    excitation : ndarray, shape (states, wavelengths)
        Excitation matrix of its states: the sum of the states absorbs.

    Returns
    -------
    passed : ndarray, shape (layers, wavelengths)
        Fraction of the light that arrives there.
    share : ndarray, shape (layers,)
        Fractions of the thickness.
    """
    density = 0.0 if settings is None else settings.optical_density
    absorbed = excitation.sum(axis=0)
    if not density or not absorbed.any():
        return np.ones((1, excitation.shape[1])), np.ones(1)
    nodes, weights = np.polynomial.legendre.leggauss(
        LAYERS + math.ceil(LAYERS_PER_DENSITY * density)
    )
    passed = 10.0 ** (-density * np.outer((nodes + 1) / 2, absorbed / absorbed.max()))
    return passed, weights / 2
