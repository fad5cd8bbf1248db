"""Whether the card shows the LEDs that were to be lit, and only these."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from labrig.analyse.led_fluorescence.lit_patches import LitPatch
from labrig.errors import DataError
from labrig.optics import CameraResponse, Spectrum, Transmittance
from labrig.results import FloatArray

#: Part of the brightest LED's signal from which the camera is expected to see an LED.
VISIBLE = 0.01
#: Significance in σ from which a light is seen.
SEEN_SIGMA = 5.0
#: Angle in rad between colour and expected colour that no error of curves and spectra explains,
#: and how much nearer another explanation has to be.
WRONG_COLOUR, NEARER = 0.3, 0.4


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
            yield UnusedLed(led, f"{led}: the card clips at the shortest exposure; dim the LED")
            continue
        if not is_visible[row]:
            continue
        signal, sigma = card.value[row], np.sqrt(card.variance[row])
        if not (signal > SEEN_SIGMA * sigma).any():
            yield UnusedLed(led, f"{led}: the card is dark, the LED did not light")
            continue
        angles = np.where(is_visible, _angles(signal, expected), np.inf)
        if angles[row] < WRONG_COLOUR:
            continue
        nearest = int(np.argmin(angles))
        if angles[nearest] < NEARER * angles[row]:
            swapped.append(f"{leds[nearest]} is lit as {led}")
        elif (other := _second(row, signal, expected, angles[row])) is not None:
            reason = f"{led}: the card has the colour of two LEDs, {leds[other]} is lit, too"
            yield UnusedLed(led, reason)
        else:
            yield UnusedLed(led, f"{led}: the card has another colour than this LED")
    if swapped:
        raise DataError(
            f"expected LEDs in the order of their names, got others by the card's colour "
            f"({', '.join(swapped)}); correct the rig file's channels, then process the run again"
        )


def _expected(spectrum: Spectrum, camera: CameraResponse, white: Transmittance) -> FloatArray:
    """Return the card's value in each channel under the LED, shape (k,)."""
    nm = camera.wavelength_nm
    light = spectrum.at(nm) * white.at(nm)
    power = np.trapezoid(spectrum.value, spectrum.wavelength_nm)
    return np.asarray(np.trapezoid(light * camera.sensitivity.T, nm, axis=1) / power)


def _angles(signal: FloatArray, expected: FloatArray) -> FloatArray:
    """Return the angle in rad between a colour (k,) and each expected one (m, k), shape (m,)."""
    lengths = np.linalg.norm(expected, axis=1) * np.linalg.norm(signal)
    cosines = expected @ signal / np.maximum(lengths, np.finfo(np.float64).tiny)
    return np.asarray(np.arccos(np.clip(cosines, -1.0, 1.0)))


def _second(row: int, signal: FloatArray, expected: FloatArray, angle: float) -> int | None:
    """Return the LED that explains the colour together with the right one; None if none does."""
    best = None
    for other in range(len(expected)):
        if other == row:
            continue
        both = expected[[row, other]].T
        amounts, _ = nnls(both, signal)
        left = float(_angles(signal, (both @ amounts)[np.newaxis])[0])
        if amounts.min() > 0 and left < NEARER * angle and (best is None or left < best[0]):
            best = left, other
    return None if best is None else best[1]
