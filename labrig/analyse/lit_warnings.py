"""What is to be known before a measured matrix is used, as lines for people."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from labrig.analyse.lit_patches import LightKind, LitPatch
from labrig.fit.fluorescence import (
    ExtrapolatedExcitation,
    FluorescenceFit,
    MoreThanWhite,
    UnexplainedValues,
    UnknownBrightness,
)
from labrig.foundation.errors import DataError
from labrig.foundation.number_format import plus_minus
from labrig.material import physical_warnings
from labrig.results import Measured

#: Part of the lit value from which light without an LED counts.
LEFT = 0.002
#: Change under the first LED from which a sample has bleached, if it is that many σ.
BLEACHED, BLEACHED_SIGMA = 0.02, 3.0


def exchanged_warnings(places: Mapping[str, str], kind: LightKind = "LED") -> Iterator[str]:
    """Yield a line if lights are lit in one another's places, by the one that is lit for each."""
    if places:
        which = ", ".join(f"{light} for {name}" for name, light in places.items())
        yield (
            f"{', '.join(places)}: expected {kind}s in the order of their names, got others by the "
            f"card's colour ({which}); the frames count as those of the {kind} that was lit: "
            "correct the rig file before the next run"
        )


def left_warnings(
    what: str, patches: Mapping[str, LitPatch], lights: Sequence[str], kind: LightKind = "LED"
) -> Iterator[str]:
    """Yield a line if patches are bright after some light of a kind."""
    counted, most = np.zeros(len(lights), dtype=np.bool_), {}
    for name, patch in patches.items():
        brightest = patch.value.max(axis=1, keepdims=True)
        counts = patch.is_left & (patch.off > LEFT * brightest)
        if counts.any():
            most[name] = float((patch.off / brightest)[counts].max())
            counted |= counts.any(axis=1)
    if most:
        which = ", ".join(name for name, counts in zip(lights, counted, strict=True) if counts)
        worst = max(most, key=lambda name: most[name])
        yield (
            f"{what}: with all {kind}s off there was light after {which}, up to {most[worst]:.1%} "
            f"of that with the {kind} ({worst}); it is subtracted: something glows, another light "
            f"is on, or {one_of(kind)} stays lit"
        )


def one_of(kind: LightKind) -> str:
    """Return a kind of light with its article."""
    return f"an {kind}" if kind == "LED" else f"a {kind}"


def bleaching_warnings(name: str, bleaching: Measured | None) -> Iterator[str]:
    """Yield a line if a sample changed under the light."""
    if bleaching is None:
        return
    change = bleaching.value - 1
    if abs(change) > BLEACHED and abs(change) > BLEACHED_SIGMA * bleaching.sigma:
        yield (
            f"{name}: at the end of the run the first LED gave "
            f"{plus_minus(bleaching.value, bleaching.sigma)} of what it gave at its begin; the "
            "sample bleaches, or the LED drifts"
        )


def per_led_warnings(name: str, fit: FluorescenceFit) -> Iterator[str]:
    """Yield a line if no surface can have the matrix of one LED by itself, which nothing bounds."""
    try:
        physical_warnings(fit.matrix)
    except DataError as error:
        yield (
            f"{name}: the method per-led gives a matrix that no surface has, and other commands "
            f"refuse its file ({error}); take --method joint"
        )


def fact_warnings(name: str, fit: FluorescenceFit, channels: Sequence[str]) -> Iterator[str]:
    """Yield a line for each fact of an estimate."""
    for fact in fit.facts:
        match fact:
            case ExtrapolatedExcitation(input_nm, share):
                yield (
                    f"{name}: {share:.0%} of the re-radiation under equal light is excited between "
                    f"{min(input_nm):g} nm and {max(input_nm):g} nm where no LED shone: it is "
                    "extrapolated"
                )
            case UnknownBrightness(lights):
                yield (
                    f"{name}: how bright {', '.join(lights)} shone is not known, so that of what "
                    "they excite only the colour is; measure them with led_brightness"
                )
            case UnexplainedValues(reduced_chi2, light, channel, sigmas):
                yield (
                    f"{name}: no matrix explains the values (reduced χ² {reduced_chi2:.1f}); under "
                    f"{light} channel {channels[channel]} is {sigmas:.1f} σ off"
                )
            case MoreThanWhite(input_nm, fraction, sigma):
                yield (
                    f"{name}: {plus_minus(fraction, sigma)} of the light of {input_nm:g} nm comes "
                    "back, more than from a perfect white"
                )
