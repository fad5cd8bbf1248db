"""Whether the card shows the LEDs that were to be lit, and only these."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.led_fluorescence.lit_patches import LitPatch
from labrig.errors import DataError
from labrig.fit.leds import match_channels
from labrig.optics import CameraResponse, Spectrum, Transmittance
from labrig.results import FloatArray

#: Part of the brightest LED's signal from which the camera is expected to see an LED.
VISIBLE = 0.01
#: Significance in σ from which a light is seen.
SEEN_SIGMA = 5.0


@dataclass(frozen=True)
class UnusedLed:
    """An LED whose frames are left out.

    Attributes
    ----------
    led
        Its name.
    reason
        What the card shows, as a line for people.
    """

    led: str
    reason: str


def unused_leds(
    leds: Sequence[str],
    spectra: Mapping[str, Spectrum],
    camera: CameraResponse,
    white: Transmittance,
    card: LitPatch,
    kind: str = "LED",
) -> Iterator[UnusedLed]:
    """Yield the LEDs that cannot be used, by the colour of a card under each.

    Parameters
    ----------
    leds
        Names of the LEDs, in the order of the card's rows.
    spectra
        Their spectra.
    camera, white
        Curves of the camera, and reflectance of the card.
    card
        Values of the card.
    kind
        What the lights are called in messages, if not LEDs.

    Raises
    ------
    DataError
        Two LEDs or more have each other's colours: they are named in another order.
    """
    expected = np.array([_expected(spectra[led], camera, white) for led in leds])
    is_visible = expected.sum(axis=1) > VISIBLE * expected.sum(axis=1).max()
    swapped = []
    for row, led in enumerate(leds):
        if card.is_clipped[row]:
            yield UnusedLed(led, f"{led}: the card clips at the shortest exposure; dim the {kind}")
            continue
        if not is_visible[row]:
            continue
        signal, sigma = card.value[row], np.sqrt(card.variance[row])
        if not (signal > SEEN_SIGMA * sigma).any():
            yield UnusedLed(led, f"{led}: the card is dark, the {kind} did not light")
            continue
        match = match_channels(led, signal, card.variance[row], spectra, camera, white)
        if not match.is_odd(led):
            continue
        if (other := match.other(led)) is not None:
            swapped.append(f"{other} is lit as {led}")
        elif match.pair is not None:
            reason = f"{led}: the card has the colour of two {kind}s, {match.pair} is lit, too"
            yield UnusedLed(led, reason)
        else:
            yield UnusedLed(led, f"{led}: the card has another colour than this {kind}")
    if swapped:
        raise DataError(
            f"expected {kind}s in the order of their names, got others by the card's colour "
            f"({', '.join(swapped)}); correct the rig file's channels, then process the run again"
        )


def _expected(spectrum: Spectrum, camera: CameraResponse, white: Transmittance) -> FloatArray:
    """Return the card's value in each channel under the LED, shape (k,)."""
    nm = camera.wavelength_nm
    light = spectrum.at(nm) * white.at(nm)
    power = np.trapezoid(spectrum.value, spectrum.wavelength_nm)
    return np.asarray(np.trapezoid(light * camera.sensitivity.T, nm, axis=1) / power)
