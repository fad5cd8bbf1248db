"""What is to be known before a measured matrix is used, as lines for people."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from labrig.analyse.led_fluorescence.lit_patches import LitPatch
from labrig.fit.fluorescence import (
    ExtrapolatedExcitation,
    FluorescenceFit,
    MoreThanWhite,
    UnexplainedValues,
    UnknownBrightness,
)
from labrig.number_format import plus_minus
from labrig.results import Measured

#: Significance in σ, and part of the lit value, from which light without an LED counts.
SEEN_SIGMA, LEFT = 5.0, 0.002
#: Change under the first LED from which a sample has bleached, if it is that many σ.
BLEACHED, BLEACHED_SIGMA = 0.02, 3.0


def left_warnings(
    what: str, patches: Mapping[str, LitPatch], lights: Sequence[str], kind: str = "LED"
) -> Iterator[str]:
    """Yield a line for each patch that is bright after some light of a kind, as LEDs."""
    for name, patch in patches.items():
        brightest = patch.value.max(axis=1, keepdims=True)
        counts = (patch.off > SEEN_SIGMA * patch.off_sigma) & (patch.off > LEFT * brightest)
        rows = np.flatnonzero(counts.any(axis=1))
        if len(rows):
            part = float((patch.off / brightest)[counts].max())
            which = ", ".join(lights[row] for row in rows.tolist())
            yield (
                f"{what} {name}: {part:.1%} of the light is left with all {kind}s off (after "
                f"{which}), and is subtracted: it glows, or another light is on"
            )


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
