"""Checks of lights by what card and samples show, and what to know before a matrix is used."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.lit_patches import LightKind, LitPatch, mean_of
from labrig.fit.fluorescence import (
    ExtrapolatedExcitation,
    FluorescenceFit,
    MoreThanWhite,
    UnexplainedValues,
    UnknownBrightness,
)
from labrig.fit.leds import ChannelMatch, match_channels
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    Extrapolated,
    Misfit,
    ResultWarning,
    Unmeasured,
)
from labrig.material import physical_warnings
from labrig.optics import CameraResponse, Spectrum, Transmittance
from labrig.results import Measured

#: Part of the lit value from which light without an LED counts.
LEFT = 0.002
#: Change under the first LED from which a sample has bleached, if it is that many σ.
BLEACHED, BLEACHED_SIGMA = 0.02, 3.0


def exchanged_warnings(
    places: Mapping[str, str], kind: LightKind = "LED"
) -> Iterator[ResultWarning]:
    """Yield a warning if lights are lit in one another's places."""
    if places:
        yield Contradiction(
            "lights-exchanged",
            "expected {kind}s in the order of their names, got others by the card's colour "
            "({exchanged}); the frames count as those of the {kind} that was lit: correct the rig "
            "file before the next run",
            subject=", ".join(places),
            kind=kind,
            exchanged=tuple(f"{light} for {name}" for name, light in places.items()),
        )


def left_warnings(
    what: str, patches: Mapping[str, LitPatch], lights: Sequence[str], kind: LightKind = "LED"
) -> Iterator[ResultWarning]:
    """Yield a warning if patches are bright after some light of a kind."""
    counted, most = np.zeros(len(lights), dtype=np.bool_), {}
    for name, patch in patches.items():
        brightest = patch.value.max(axis=1, keepdims=True)
        counts = patch.is_left & (patch.off > LEFT * brightest)
        if counts.any():
            most[name] = float((patch.off / brightest)[counts].max())
            counted |= counts.any(axis=1)
    if most:
        worst = max(most, key=lambda name: most[name])
        yield Disturbance(
            "light-left",
            "with all {kind}s off there was light after {lights}, up to {most:.1%} of that with "
            "the {kind} ({worst}); it is subtracted: something glows, another light is on, or "
            "{a_light} stays lit",
            subject=what,
            kind=kind,
            lights=tuple(name for name, counts in zip(lights, counted, strict=True) if counts),
            most=most[worst],
            worst=worst,
            a_light=one_of(kind),
        )


def one_of(kind: LightKind) -> str:
    """Return a kind of light with its article."""
    return f"an {kind}" if kind == "LED" else f"a {kind}"


def bleaching_warnings(name: str, bleaching: Measured | None) -> Iterator[ResultWarning]:
    """Yield a warning if a sample changed under the light."""
    if bleaching is None:
        return
    change = bleaching.value - 1
    if abs(change) > BLEACHED and abs(change) > BLEACHED_SIGMA * bleaching.sigma:
        yield Disturbance(
            "sample-bleached",
            "at the end of the run the first LED gave {ratio.plus_minus} of its light at the "
            "begin; the sample bleaches, or the LED drifts",
            subject=name,
            ratio=bleaching,
        )


def per_led_warnings(name: str, fit: FluorescenceFit) -> Iterator[ResultWarning]:
    """Yield a warning if no surface can have the matrix that one LED after another gives."""
    try:
        physical_warnings(fit.matrix)
    except DataError as error:
        yield Contradiction(
            "matrix-unphysical",
            "the method per-led gives a matrix that no surface has, and other commands refuse its "
            "file ({reason}); take --method joint",
            subject=name,
            reason=str(error),
        )


def fact_warnings(
    fits: Mapping[str, FluorescenceFit], input_nm: FloatArray, channels: Sequence[str]
) -> Iterator[ResultWarning]:
    """Yield warnings for the facts of estimates; of one that samples share, one for all.

    Parameters
    ----------
    fits
        Estimate of each sample.
    input_nm
        Middles of the input bands in nm, rising.
    channels
        Names of the camera's channels.
    """
    extrapolated: dict[str, ExtrapolatedExcitation] = {}
    samples_of: dict[tuple[str, ...], list[str]] = {}
    for name, fit in fits.items():
        for fact in fit.facts:
            if isinstance(fact, ExtrapolatedExcitation):
                extrapolated[name] = fact
            elif isinstance(fact, UnknownBrightness):
                samples_of.setdefault(fact.lights, []).append(name)
            else:
                yield _fact_warning(name, fact, channels)
    if extrapolated:
        dark_nm = {nm for fact in extrapolated.values() for nm in fact.input_nm}
        yield Extrapolated(
            "excitation-extrapolated",
            "of the re-radiation under equal light {shares} is excited at {gaps_nm} nm, where no "
            "LED shone: that part is extrapolated",
            shares=tuple(
                f"{100 * fact.share:.0f} % ({name})" for name, fact in extrapolated.items()
            ),
            gaps_nm=_gaps_nm(dark_nm, input_nm),
            share={name: fact.share for name, fact in extrapolated.items()},
        )
    for lights, samples in samples_of.items():
        yield Unmeasured(
            "light-unscaled",
            "the brightness of {lights} was not measured: the colour of the light that they "
            "excite is determined, its amount is not; measure them with led_brightness",
            subject=", ".join(samples),
            lights=lights,
        )


def _gaps_nm(dark_nm: Collection[float], input_nm: FloatArray) -> tuple[str, ...]:
    """Return the ranges of neighbouring bands that no light reached."""
    gaps: list[list[float]] = []
    is_open = False
    for nm in input_nm.tolist():
        if nm not in dark_nm:
            is_open = False
        elif is_open:
            gaps[-1][1] = nm
        else:
            gaps.append([nm, nm])
            is_open = True
    return tuple(f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in gaps)


def _fact_warning(
    name: str, fact: UnexplainedValues | MoreThanWhite, channels: Sequence[str]
) -> ResultWarning:
    match fact:
        case UnexplainedValues(reduced_chi2, light, channel, sigmas):
            return Misfit(
                "matrix-misfit",
                "no matrix explains the values (reduced χ² {reduced_chi2:.1f}); under {light} "
                "channel {channel} is {most_sigmas:.1f} σ off",
                subject=name,
                reduced_chi2=reduced_chi2,
                light=light,
                channel=channels[channel],
                most_sigmas=sigmas,
            )
        case MoreThanWhite(input_nm, fraction, sigma):
            return Contradiction(
                "more-than-white",
                "{fraction.plus_minus} of the light of {input_nm:g} nm comes back, more than "
                "from a perfect white",
                subject=name,
                fraction=Measured(fraction, sigma),
                input_nm=input_nm,
            )


#: Part of the brightest LED's signal from which the camera is expected to see an LED.
VISIBLE = 0.01
#: Part of what a card gives under the other LEDs that it cannot give under one that the camera is
#: not expected to see.
TOO_BRIGHT = 0.2
#: Part of the light with the LED on that has to go when it goes off: flicker is less.
GOES_OFF = 0.02


@dataclass(frozen=True)
class UnusedLed:
    """An LED, or a lamp, whose frames are left out.

    Attributes
    ----------
    led
        Its name.
    reason
        Warning of what card or samples show, and of what to do.
    light
        The one that is lit in its place, None if none is known.
    """

    led: str
    reason: ResultWarning
    light: str | None = None


@dataclass(frozen=True)
class UsableLights:
    """Lights of a kind of which there are frames that can be used.

    Attributes
    ----------
    by_row
        The light that was lit, which need not be the one that was to be, by the row of its frames.
    left_out
        A warning of each reason to leave others out.
    exchanged
        Warnings of lights that have only changed places.
    light_of
        The light that is lit in the place of each of these.
    """

    by_row: Mapping[int, str]
    left_out: Sequence[ResultWarning]
    exchanged: Sequence[ResultWarning]
    light_of: Mapping[str, str]

    @property
    def warnings(self) -> list[ResultWarning]:
        """All warnings."""
        return [*self.left_out, *self.exchanged]


def usable_lights(
    names: Sequence[str],
    spectra: Mapping[str, Spectrum],
    camera: CameraResponse,
    white: Transmittance,
    cards: Mapping[str, LitPatch],
    samples: Mapping[str, LitPatch],
    kind: LightKind = "LED",
) -> UsableLights:
    """Return the lights of a kind that can be used; parameters are those of `unused_leds`."""
    unused = list(unused_leds(names, spectra, camera, white, cards, samples, kind))
    light_of = exchanged(unused)
    unused = [one for one in unused if one.led not in light_of]
    out = {one.led for one in unused}
    return UsableLights(
        {row: light_of.get(name, name) for row, name in enumerate(names) if name not in out},
        left_out_warnings(unused),
        list(exchanged_warnings(light_of, kind)),
        light_of,
    )


def left_out_warnings(unused: Sequence[UnusedLed]) -> list[ResultWarning]:
    """Return a warning for each reason, about the LEDs that have it."""
    leds: dict[ResultWarning, list[str]] = {}
    for one in unused:
        leds.setdefault(one.reason, []).append(one.led)
    return [reason.about(", ".join(names)) for reason, names in leds.items()]


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
    kind: LightKind = "LED",
) -> Iterator[UnusedLed]:
    """Yield the lights of a kind that cannot be used, by card and samples under each.

    Parameters
    ----------
    leds
        Names of the lights, in the order of the patches' rows.
    spectra
        Their spectra.
    camera, white
        Curves of the camera, and reflectance of the card.
    cards, samples
        Values of the card in the place of each patch, and of the patches.
    kind
        What the lights are called in messages.
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

    matches: dict[str, ChannelMatch] = {}
    for row, led in enumerate(leds):
        needs_light = bool(is_visible[row])
        reason = _unlit(row, "card", cards, kind, needs_light=needs_light)
        reason = reason or _unlit(row, "samples", samples, kind, needs_light=needs_light)
        if reason is not None:
            yield UnusedLed(led, reason)
        elif not is_visible[row]:
            if lit.is_seen[row] and brightest[row] > TOO_BRIGHT * usual:
                match = match_channels(visible[0], *at(row), of_visible, camera, white)
                best = min(match.chi2, key=lambda name: match.chi2[name])
                yield _odd(led, None if match.is_odd(best) else best, None, kind)
        else:
            matches[led] = match_channels(led, *at(row), spectra, camera, white)
    odd = {led: match.other(led) for led, match in matches.items() if match.is_odd(led)}
    for led, other in odd.items():
        yield _odd(led, other, matches[led].pair, kind)
        if other in matches and other not in odd and _is_rather(matches[other], led, other):
            yield _odd(other, led, None, kind)


def _unlit(
    row: int, what: str, patches: Mapping[str, LitPatch], kind: LightKind, *, needs_light: bool
) -> ResultWarning | None:
    """Return what is amiss with a light on the patches, None if nothing is."""
    if any(patch.is_clipped[row] for patch in patches.values()):
        return Disturbance(
            "light-clipped",
            "left out, frames of the {target} clip at the shortest exposure; dim the {kind}, lower "
            "camera.iso or close the aperture",
            target=what,
            kind=kind,
        )
    if any(patch.is_off_clipped[row] for patch in patches.values()):
        return Disturbance(
            "light-clipped-off",
            "left out, frames of the {target} clip with all {kind}s off; {a_light} stays lit, or "
            "another light is on: check the {kind}s' relays, darken the room",
            target=what,
            kind=kind,
            a_light=one_of(kind),
        )
    if not needs_light:
        return None
    if not any(patch.is_seen[row] for patch in patches.values()):
        return Unmeasured(
            "light-unlit",
            "left out, frames of the {target} are dark; the {kind} did not light: check its plug",
            target=what,
            kind=kind,
        )
    if not any(_goes_off(patch, row) for patch in patches.values()):
        return Unmeasured(
            "light-stays",
            "left out, frames of the {target} are as bright with all {kind}s off; the {kind} did "
            "not light or stays lit: check its plug and its relay",
            target=what,
            kind=kind,
        )
    return None


def _goes_off(patch: LitPatch, row: int) -> bool:
    light = patch.without_rest()
    part = light.value[row] > GOES_OFF * patch.value[row]
    return bool((part & (light.value[row] > DETECTION_SIGMA * np.sqrt(light.variance[row]))).any())


def _is_rather(match: ChannelMatch, led: str, named: str) -> bool:
    """Return whether a light is that of an LED rather than of the one named, if not clearly so.

    Broadband lamps differ by less than the errors of a camera's curves, but one whose light is seen
    elsewhere is not in its own place.
    """
    return match.chi2.get(led, math.inf) < match.chi2[named]


def _odd(led: str, other: str | None, pair: str | None, kind: LightKind) -> UnusedLed:
    reason: ResultWarning
    if other is not None:
        reason = Contradiction(
            "light-is-another",
            "left out, the card has the colour of {other}; correct the order of the {kind}s in the "
            "rig file",
            other=other,
            kind=kind,
        )
    elif pair is not None:
        reason = Disturbance(
            "two-lights",
            "left out, the card has the colour of two {kind}s, {other} is lit, too; check their "
            "relays",
            other=pair,
            kind=kind,
        )
    else:
        reason = Contradiction(
            "light-colour-differs",
            "left out, the card has another colour than under this {kind}; correct its {keys} in "
            "the rig file",
            kind=kind,
            keys="'centre' and 'fwhm'" if kind == "LED" else "'spectrum' and 'filter'",
        )
    return UnusedLed(led, reason, other)


def _expected(spectrum: Spectrum, camera: CameraResponse, white: Transmittance) -> FloatArray:
    """Return the card's value in each channel under a light, shape (k,)."""
    nm = camera.wavelength_nm
    light = spectrum.at(nm) * white.at(nm)
    power = np.trapezoid(spectrum.value, spectrum.wavelength_nm)
    return np.asarray(np.trapezoid(light * camera.sensitivity.T, nm, axis=1) / power)
