"""What can be amiss with LEDs: dark, two at once, another one, a reference that fluoresces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from labrig.calibration import UV_NM
from labrig.fit.leds import ChannelMatch, LedBand, light_within, match_channels
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    ResultWarning,
    Unmeasured,
)
from labrig.optics import CameraResponse, Spectrum, Transmittance
from labrig.protocols.led_brightness.analysis.readings import CameraValues, Spectrometry

#: Difference in nm from the rig file's peak that bins of makers and warmth do not explain.
OFF_NM = 10.0
#: Light beside a band, relative to it, that is another LED's or a dye's.
BESIDE = 0.01
#: Step in nm in which light beside a band is looked for.
BIN_NM = 10.0
#: Factor by which an LED's band may be wider than by the rig file, with its wings.
WINGS = 1.5
#: Difference in nm up to which light under several LEDs is that of one dye.
ALIKE_NM = 25.0
#: Wavelength in nm up to which LEDs excite brighteners, of paper and plastics.
EXCITING_NM = 440.0
#: Half width in nm of an LED's band about its peak, in which another one would lie.
HALF_BAND_NM = 15.0


@dataclass(frozen=True, eq=False)
class Bank:
    """The LEDs as the rig file names them, and what sees them.

    Attributes
    ----------
    nominal
        Spectrum of each LED by the rig file.
    sketched
        LEDs of which it says peak and width only.
    sheet_sigma_nm
        Standard uncertainty of the centroid of each of these spectra in nm.
    camera, card
        The camera's curves, and the reflectance of the white reference.
    """

    nominal: Mapping[str, Spectrum]
    sketched: frozenset[str]
    sheet_sigma_nm: Mapping[str, float]
    camera: CameraResponse
    card: Transmittance

    def peak_nm(self, name: str) -> float:
        """Return the peak of an LED by the rig file in nm."""
        light = self.nominal[name]
        return float(light.wavelength_nm[light.value.argmax()])

    def nearest(self, wavelength_nm: float) -> str:
        """Return the LED whose peak is nearest."""
        return min(self.nominal, key=lambda name: abs(self.peak_nm(name) - wavelength_nm))


@dataclass
class Checked:
    """Readings and LEDs that the checks leave to be used.

    Attributes
    ----------
    warnings
        What is amiss; `leds` among their values are the LEDs that they concern.
    left_out
        LEDs that did not light as they should.
    without_camera, without_spectrometer
        LEDs whose values by the camera, and whose spectra, are not used.
    """

    warnings: list[ResultWarning] = field(default_factory=list)
    left_out: set[str] = field(default_factory=set)
    without_camera: set[str] = field(default_factory=set)
    without_spectrometer: set[str] = field(default_factory=set)


def check_leds(
    bank: Bank,
    values: Mapping[str, CameraValues],
    spectra: Mapping[str, Spectrometry],
    planned: Sequence[str],
) -> Checked:
    """Compare what was seen of every LED with what its name lets expect.

    Parameters
    ----------
    bank
        The LEDs by the rig file.
    values, spectra
        What camera and spectrometer saw, by the LED's name; only of completed units.
    planned
        LEDs of the protocol.
    """
    checked = Checked()
    for name in planned:
        if name not in values:
            checked.left_out.add(name)
            checked.warnings.append(
                Unmeasured(
                    "led-not-measured",
                    "LED '{leds}' was not measured: its unit is not complete; resume the run",
                    leds=(name,),
                )
            )
    _check_ambient(checked, values)
    _check_ranges(checked, values, spectra)
    for name in values:
        _check_lit(checked, bank, name, values[name], spectra.get(name))
    _check_spectra(checked, bank, spectra)
    _check_channels(checked, bank, values, spectra)
    return checked


def _check_ambient(checked: Checked, values: Mapping[str, CameraValues]) -> None:
    if ambient := [name for name, seen in values.items() if seen.is_ambient]:
        checked.warnings.append(
            Disturbance(
                "light-left",
                "with all LEDs off there was light, after {leds} (up to {most_dn_per_s:.3g} DN/s); "
                "it was subtracted as if it had been steady: darken the room, see that no LED "
                "stays lit",
                leds=tuple(ambient),
                most_dn_per_s=max(float(values[name].off.max()) for name in ambient),
            )
        )


def _check_ranges(
    checked: Checked, values: Mapping[str, CameraValues], spectra: Mapping[str, Spectrometry]
) -> None:
    if clipped := [name for name, seen in values.items() if seen.is_clipped]:
        checked.without_camera.update(clipped)
        checked.warnings.append(
            Disturbance(
                "light-clipped",
                "the camera's frames of {leds} are clipped even at the shortest exposure and are "
                "left out; dim the LED, lower camera.iso or close the aperture",
                leds=tuple(clipped),
            )
        )
    if bright := [name for name, seen in values.items() if seen.is_off_clipped]:
        checked.without_camera.update(bright)
        checked.warnings.append(
            Disturbance(
                "light-clipped-off",
                "with all LEDs off the camera's frames are clipped after {leds}: an LED stays lit, "
                "or another light is on; the camera's values are left out: check the LEDs' relays, "
                "darken the room",
                leds=tuple(bright),
            )
        )
    if saturated := [name for name, seen in spectra.items() if seen.is_saturated]:
        checked.without_spectrometer.update(saturated)
        checked.warnings.append(
            Disturbance(
                "spectrometer-saturated",
                "the spectrometer is saturated by {leds}, whose spectra are left out; dim the LED "
                "or move the spectrometer's head away",
                leds=tuple(saturated),
            )
        )


def _check_lit(
    checked: Checked, bank: Bank, name: str, value: CameraValues, seen: Spectrometry | None
) -> None:
    by_camera = value.is_seen or value.is_clipped
    by_spectrometer = seen is not None and (seen.band is not None or seen.is_saturated)
    if by_spectrometer or (by_camera and seen is None):
        return
    if by_camera:
        checked.without_spectrometer.add(name)
        checked.warnings.append(
            Unmeasured(
                "led-unseen",
                "the spectrometer saw nothing of LED '{leds}', the camera did; is its head before "
                "the white reference?",
                leds=(name,),
            )
        )
        return
    checked.without_camera.add(name)
    if seen is None and bank.peak_nm(name) < UV_NM:
        checked.warnings.append(
            Unmeasured(
                "led-unseen",
                "the camera sees nothing of LED '{leds}': nothing shows that it lit; look at it "
                "through something that fluoresces",
                leds=(name,),
            )
        )
        return
    checked.left_out.add(name)
    if value.is_ambient or value.is_off_clipped:
        warning = Unmeasured(
            "light-stays",
            "LED '{leds}' changes nothing, with all LEDs off it is as bright: it did not light or "
            "stays lit, and is left out; check its plug, its output and its relay",
            leds=(name,),
        )
    else:
        warning = Unmeasured(
            "light-unlit",
            "LED '{leds}' did not light and is left out; check its current, plug and output",
            leds=(name,),
        )
    checked.warnings.append(warning)


def _check_spectra(checked: Checked, bank: Bank, spectra: Mapping[str, Spectrometry]) -> None:
    """Compare measured spectra with the names."""
    bands = {
        name: seen.band
        for name, seen in spectra.items()
        if seen.band is not None and name not in checked.left_out
        and name not in checked.without_spectrometer
    }  # fmt: skip
    for name, band in bands.items():
        off_nm, nearest = band.centroid_nm - bank.peak_nm(name), bank.nearest(band.centroid_nm)
        if abs(off_nm) <= OFF_NM:
            continue
        if nearest != name and abs(band.centroid_nm - bank.peak_nm(nearest)) <= OFF_NM:
            warning = Contradiction(
                "light-is-another",
                "LED '{led}' shines like '{other}', about {centroid_nm:.0f} nm: LEDs are connected "
                "in another order than the rig file names them; its measured spectrum counts, "
                "correct the rig file",
                led=name,
                other=nearest,
                centroid_nm=band.centroid_nm,
                leds=(name, nearest),
            )
        else:
            warning = Contradiction(
                "peak-differs",
                "LED '{leds}' shines about {centroid_nm:.0f} nm, {off_nm:+.0f} nm from the value "
                "in the rig file; its measured spectrum counts, correct the rig file",
                leds=(name,),
                centroid_nm=band.centroid_nm,
                off_nm=off_nm,
            )
        checked.warnings.append(warning)
    fluorescent = {}
    lit_beside = {
        name: light for name, band in bands.items() if (light := _beside(band)) is not None
    }
    short = {
        name: light
        for name, light in lit_beside.items()
        if bands[name].centroid_nm < min(EXCITING_NM, light[1])
    }
    for name, (part, centre_nm, rms_nm) in lit_beside.items():
        nearest = bank.nearest(centre_nm)
        is_led = nearest != name and abs(bank.peak_nm(nearest) - centre_nm) <= HALF_BAND_NM
        alike = [light for light in short.values() if abs(light[1] - centre_nm) <= ALIKE_NM]
        if name in short and len(alike) > 1:
            fluorescent[name] = part, centre_nm
        elif is_led and rms_nm <= _rms_nm(bank.nominal[nearest]) * WINGS + BIN_NM / 2:
            checked.left_out.add(name)
            checked.warnings.append(
                Disturbance(
                    "two-lights",
                    "under LED '{led}' there is {part:.0%} as much light about {centre_nm:.0f} nm: "
                    "LED '{other}' was lit at the same time; '{led}' is left out, check the "
                    "outputs",
                    led=name,
                    other=nearest,
                    part=part,
                    centre_nm=centre_nm,
                    leds=(name, nearest),
                )
            )
        elif name in short:
            fluorescent[name] = part, centre_nm
    if fluorescent:
        checked.without_camera.update(fluorescent)
        part, centre_nm = max(fluorescent.values())
        checked.warnings.append(
            Disturbance(
                "reference-fluoresces",
                "the white reference fluoresces: under {leds} it sends out up to {part:.1%} as "
                "much light about {centre_nm:.0f} nm; the camera's values under these LEDs are "
                "left out: take a reference of PTFE or barium sulphate",
                leds=tuple(fluorescent),
                part=part,
                centre_nm=centre_nm,
            )
        )


def _beside(band: LedBand) -> tuple[float, float, float] | None:
    """Return part, centre and rms width in nm of the light beside a band; None if there is none."""
    low_nm, high_nm = float(band.wavelength_nm[0]), float(band.wavelength_nm[-1])
    edges = np.arange(low_nm, high_nm, BIN_NM)
    parts = [light_within(band, edge, edge + BIN_NM) for edge in edges]
    lit = np.array([part > DETECTION_SIGMA * sigma and part > BESIDE / 20 for part, sigma in parts])
    # The flanks of a band are under the noise one by one, and make it wide.
    flanks = np.convolve(lit, np.ones(3), mode="same") > 0
    light = np.maximum([part for part, _ in parts], 0.0) * flanks
    if not lit.any() or light.sum() < BESIDE:
        return None
    middles = edges + BIN_NM / 2
    centre = float(light @ middles / light.sum())
    rms = float(np.sqrt(light @ (middles - centre) ** 2 / light.sum()))
    return float(light.sum()), centre, rms


def _check_channels(
    checked: Checked,
    bank: Bank,
    values: Mapping[str, CameraValues],
    spectra: Mapping[str, Spectrometry],
) -> None:
    """Compare channel ratios with the names, where no spectrum is measured."""
    odd: dict[str, ChannelMatch] = {}
    judged = [
        name
        for name, seen in values.items()
        if name not in checked.left_out | checked.without_camera and seen.is_seen
        and (name not in spectra or name in checked.without_spectrometer)
    ]  # fmt: skip
    for name in judged:
        seen = values[name]
        match = match_channels(
            name, seen.value, seen.sigma**2, bank.nominal, bank.camera, bank.card
        )
        if match.is_odd(name):
            odd[name] = match
    short = [name for name in judged if bank.peak_nm(name) < EXCITING_NM]
    # LEDs in another order are odd in pairs.
    others = {name: match.other(name) for name, match in odd.items()}
    swapped = {
        name: other
        for name, other in others.items()
        if other is not None and (other in odd or other not in judged)
    }
    unexplained = [name for name in short if name in odd and name not in swapped]
    if unexplained and len(unexplained) > len(odd) / 2 and _is_redder(bank, values, unexplained):
        checked.without_camera.update(unexplained)
        checked.warnings.append(
            Disturbance(
                "reference-fluoresces",
                "the white reference seems to fluoresce: under {leds} channels of longer "
                "wavelengths see more than the LEDs' light explains; these values are left out: "
                "take a reference of PTFE or barium sulphate",
                leds=tuple(unexplained),
            )
        )
    for name, match in odd.items():
        if name in checked.without_camera:
            continue
        warning: ResultWarning
        checked.left_out.add(name)
        other = swapped.get(name)
        if other is not None:
            warning = Contradiction(
                "light-is-another",
                "LED '{led}' shines like '{other}': LEDs are connected in another order than the "
                "rig file names them; '{led}' is left out, correct the rig file",
                led=name,
                other=other,
                leds=(name, other),
            )
        elif match.pair is not None:
            warning = Disturbance(
                "two-lights",
                "under LED '{led}' the camera's channels see '{other}', too: two were lit at the "
                "same time; '{led}' is left out, check the outputs",
                led=name,
                other=match.pair,
                leds=(name, match.pair),
            )
        else:
            warning = Contradiction(
                "light-colour-differs",
                "the camera's channel ratios under LED '{leds}' are those of no LED of the rig "
                "file; it is left out: correct its 'centre' and 'fwhm'",
                leds=(name,),
            )
        checked.warnings.append(warning)


def _is_redder(bank: Bank, values: Mapping[str, CameraValues], names: Sequence[str]) -> bool:
    """Return whether all of some LEDs look redder to the camera than their light."""
    mean_nm = bank.camera.wavelength_nm @ bank.camera.sensitivity
    channel_nm = mean_nm / bank.camera.sensitivity.sum(axis=0)

    def looks_nm(value: np.ndarray) -> float:
        positive = np.maximum(value, 0.0)
        return float(positive @ channel_nm / positive.sum())

    for name in names:
        nodes = bank.camera.wavelength_nm
        light = bank.nominal[name].resampled(nodes).value * bank.card.at(nodes)
        expected = light @ bank.camera.sensitivity
        if expected.sum() > 0 and looks_nm(values[name].value) <= looks_nm(expected):
            return False
    return True


def unseen_channels(bank: Bank, values: Mapping[str, CameraValues]) -> list[str]:
    """Return the channels that see no LED."""
    unseen = []
    for number, channel in enumerate(bank.camera.channels):
        seen = [
            card.value[number] > DETECTION_SIGMA * card.sigma[number]
            for card in values.values()
            if not card.is_clipped
        ]
        if seen and not any(seen):
            unseen.append(channel)
    return unseen


def _rms_nm(spectrum: Spectrum) -> float:
    """Return the rms width of a spectrum in nm."""
    weight = spectrum.value * np.gradient(spectrum.wavelength_nm)
    centre = float(weight @ spectrum.wavelength_nm / weight.sum())
    return float(np.sqrt(weight @ (spectrum.wavelength_nm - centre) ** 2 / weight.sum()))
