"""Whether card and samples show the LEDs that were to be lit, and only these."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.led_fluorescence.lit_patches import SEEN_SIGMA, LitPatch, mean_of
from labrig.fit.leds import match_channels
from labrig.optics import CameraResponse, Spectrum, Transmittance
from labrig.results import FloatArray

#: Part of the brightest LED's signal from which the camera is expected to see an LED.
VISIBLE = 0.01
#: Part of what a card gives under the other LEDs that it cannot give under one that the camera is
#: not expected to see.
TOO_BRIGHT = 0.2
#: Part of the light with the LED on that has to go when it goes off: flicker is less.
GOES_OFF = 0.02


@dataclass(frozen=True)
class UnusedLed:
    """An LED whose frames are left out.

    Attributes
    ----------
    led
        Its name.
    reason
        What card or samples show, and what to do.
    light
        The LED that is lit in its place, None if none is known.
    """

    led: str
    reason: str
    light: str | None = None


def lines_of(unused: Sequence[UnusedLed]) -> list[str]:
    """Return a line for each reason, with the LEDs that have it."""
    leds: dict[str, list[str]] = {}
    for one in unused:
        leds.setdefault(one.reason, []).append(one.led)
    return [f"{', '.join(names)}: left out, {reason}" for reason, names in leds.items()]


def exchanged(unused: Sequence[UnusedLed]) -> dict[str, str]:
    """Return the LED that is lit in the place of each, where LEDs have only changed places."""
    light = {one.led: one.light for one in unused if one.light is not None}
    while lost := {led for led in light if light[led] not in light}:
        light = {led: other for led, other in light.items() if led not in lost}
    return light if len(set(light.values())) == len(light) else {}


def unused_leds(
    leds: Sequence[str],
    spectra: Mapping[str, Spectrum],
    camera: CameraResponse,
    white: Transmittance,
    cards: Mapping[str, LitPatch],
    samples: Mapping[str, LitPatch],
) -> Iterator[UnusedLed]:
    """Yield the LEDs that cannot be used, by the light of card and samples under each.

    Parameters
    ----------
    leds
        Names of the LEDs, in the order of the patches' rows.
    spectra
        Their spectra.
    camera, white
        Curves of the camera, and reflectance of the card.
    cards, samples
        Values of the card in the place of each patch, and of the patches.
    """
    card = mean_of(cards)
    lit = card.without_rest()
    expected = np.array([_expected(spectra[led], camera, white) for led in leds])
    is_visible = expected.sum(axis=1) > VISIBLE * expected.sum(axis=1).max()
    brightest = lit.value.max(axis=1)
    usual = float(np.median(brightest[is_visible]))
    visible = [led for led, seen in zip(leds, is_visible, strict=True) if seen]
    of_visible = {led: spectra[led] for led in visible}

    def at(row: int) -> tuple[FloatArray, FloatArray]:
        return lit.value[row], lit.variance[row]

    for row, led in enumerate(leds):
        if reason := _unlit(row, "card", cards, needs_light=bool(is_visible[row])):
            yield UnusedLed(led, reason)
        elif not is_visible[row]:
            if lit.is_seen[row] and brightest[row] > TOO_BRIGHT * usual:
                match = match_channels(visible[0], *at(row), of_visible, camera, white)
                best = min(match.chi2, key=lambda name: match.chi2[name])
                yield _odd(led, None if match.is_odd(best) else best, None)
        elif reason := _unlit(row, "samples", samples, needs_light=True):
            yield UnusedLed(led, reason)
        else:
            match = match_channels(led, *at(row), spectra, camera, white)
            if match.is_odd(led):
                yield _odd(led, match.other(led), match.pair)


def _unlit(
    row: int, what: str, patches: Mapping[str, LitPatch], *, needs_light: bool
) -> str | None:
    """Return what is amiss with the light of an LED on the patches, None if nothing is."""
    if any(patch.is_clipped[row] for patch in patches.values()):
        return (
            f"frames of the {what} clip at the shortest exposure; dim the LED, lower camera.iso or "
            "close the aperture"
        )
    if any(patch.is_off_clipped[row] for patch in patches.values()):
        return (
            f"frames of the {what} clip with all LEDs off; an LED stays lit, or another light is "
            "on: check the LEDs' relays, darken the room"
        )
    if not needs_light:
        return None
    if not any(patch.is_seen[row] for patch in patches.values()):
        return f"frames of the {what} are dark; the LED did not light: check its plug"
    if not any(_goes_off(patch, row) for patch in patches.values()):
        return (
            f"frames of the {what} are as bright with all LEDs off; the LED did not light or stays "
            "lit: check its plug and its relay"
        )
    return None


def _goes_off(patch: LitPatch, row: int) -> bool:
    light = patch.without_rest()
    part = light.value[row] > GOES_OFF * patch.value[row]
    return bool((part & (light.value[row] > SEEN_SIGMA * np.sqrt(light.variance[row]))).any())


def _odd(led: str, other: str | None, pair: str | None) -> UnusedLed:
    if other is not None:
        reason = (
            f"the card has the colour of {other}; correct the order of the LEDs in the rig file"
        )
    elif pair is not None:
        reason = f"the card has the colour of two LEDs, {pair} is lit, too; check their relays"
    else:
        reason = (
            "the card has another colour than under this LED; correct its 'centre' and 'fwhm' in "
            "the rig file"
        )
    return UnusedLed(led, reason, other)


def _expected(spectrum: Spectrum, camera: CameraResponse, white: Transmittance) -> FloatArray:
    """Return the card's value in each channel under the LED, shape (k,)."""
    nm = camera.wavelength_nm
    light = spectrum.at(nm) * white.at(nm)
    power = np.trapezoid(spectrum.value, spectrum.wavelength_nm)
    return np.asarray(np.trapezoid(light * camera.sensitivity.T, nm, axis=1) / power)
