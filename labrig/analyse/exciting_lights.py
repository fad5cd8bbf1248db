"""Spectra of the lights that are selected one after another, by a spectrometer or the rig file.

A spectrometer that faces the card under the lamp and under a light measures the light over the
lamp, whatever its own response and the card's: times the lamp's spectrum, that is the light on the
lamp's scale.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.acquire import MONOCHROMATOR, driver_and_settings
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import filter_transmittances, led_sources
from labrig.calibration import LEDS_KIND
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.optics import (
    SpectrometerReading,
    Spectrum,
    Transmittance,
    read_spectrometer_reading,
)
from labrig.protocols.steps.exciting_lights import CardSpectra, ExcitingLights, light_unit
from labrig.record import SpectrumRecord

#: Relative σ of the transmittance in a filter's file, and σ of its wavelengths in nm.
FILTER_SIGMA, FILTER_NM = 0.02, 0.5
#: Relative σ of one reading of a spectrometer over another, and σ of its wavelengths in nm.
READING_SIGMA, READING_NM = 0.01, 0.3
#: Pixels over which readings are smoothed, and limit of detection in σ.
SMOOTHED, SEEN = 5, 4.0
#: Distance from the middle of a light, in its standard deviations, within which all of it lies.
NEAR = 5.0
#: Fraction of the lamp's strongest counts below which its light is not seen.
MIN_LAMP = 2e-3


@dataclass(frozen=True)
class ExcitingLight:
    """A light as far as it is known before it is measured.

    Attributes
    ----------
    spectrum
        Its spectrum, on the scale of the lamp's where `level_sigma` is finite.
    level_sigma
        Relative σ of that scale; infinite where it is unknown.
    wavelength_sigma_nm
        σ in nm of an error that all wavelengths have in common.
    """

    spectrum: Spectrum
    level_sigma: float
    wavelength_sigma_nm: float

    def shifted(self, grid_nm: FloatArray) -> FloatArray:
        """Return the spectrum at some wavelengths with its own moved by one σ."""
        return self.spectrum.at(grid_nm - self.wavelength_sigma_nm)


def exciting_lights(
    context: AnalysisContext, lights: ExcitingLights, lamp: Spectrum
) -> list[ExcitingLight]:
    """Return what is known of all lights of a run without the camera, in order.

    Parameters
    ----------
    part
        Part of a run.
    lights
        Lights that the protocol selects.
    lamp
        Spectrum of the lamp.

    Raises
    ------
    UsageError
        Nothing is known of a filter, of an LED, or of the monochromator's band.
    DataError
        The spectrometer saw nothing of the lamp.
    """
    if context.run.spectra(CardSpectra.DIRECT):
        return [_measured(context, name, lamp) for name in lights.names()]
    if lights.leds:
        known = led_sources(context.rig, context.rig.name, context.inputs[LEDS_KIND])
        if missing := [name for name in lights.leds if name not in known]:
            raise UsageError(
                f"rig '{context.rig.name}': expected an LED '{missing[0]}', got {', '.join(known)}"
            )
        exposures = [known[name] for name in lights.leds]
        return [ExcitingLight(one.light, math.inf, one.wavelength_sigma_nm) for one in exposures]
    if lights.filters:
        curves = filter_transmittances(context.rig, lights.filters)
        return [ExcitingLight(_through(lamp, each), FILTER_SIGMA, FILTER_NM) for each in curves]
    if MONOCHROMATOR.key not in context.rig.devices:
        raise UsageError(
            f"rig '{context.rig.name}': expected 'monochromator' under 'devices', which "
            "has the width "
            "of its band, found none"
        )
    _, band = driver_and_settings(context.rig, MONOCHROMATOR.key, context.rig.name)
    return [
        ExcitingLight(_through(lamp, band.transmittance(nm)), math.inf, band.wavelength_sigma)
        for nm in lights.monochromator
    ]


def _measured(context: AnalysisContext, name: str, lamp: Spectrum) -> ExcitingLight:
    """Return a light by the spectrometer, over the lamp that it has read in the same rounds."""
    units = {light_unit(name, number) for number in range(1, context.protocol.rounds + 1)}
    readings = [one for one in context.run.spectra(CardSpectra.LIGHT) if one.unit in units]
    dark = {
        one.integration_s: read_spectrometer_reading(one.path)
        for one in context.run.spectra(CardSpectra.DARK)
    }
    grid_nm, of_lamp, lamp_sigma = _mean_rate(context.run.spectra(CardSpectra.DIRECT), dark)
    _, rate, sigma = _mean_rate(readings, dark)
    is_lit = of_lamp > np.maximum(SEEN * lamp_sigma, MIN_LAMP * of_lamp.max())
    if np.count_nonzero(is_lit) < SMOOTHED:
        raise DataError(
            f"{context.run.folder}: expected the lamp's light in the "
            "spectrometer's readings of the "
            "card, got none; turn its head to the card"
        )
    is_seen = rate > SEEN * sigma
    if not is_seen[is_lit].any():
        raise DataError(f"{context.run.folder}: the spectrometer saw nothing of the light '{name}'")
    # Far from the light there is only noise, which would add to other bands.
    weight = np.where(is_seen & is_lit, rate, 0.0)
    middle_nm = np.average(grid_nm, weights=weight)
    width_nm = np.sqrt(np.average((grid_nm - middle_nm) ** 2, weights=weight))
    is_near = np.abs(grid_nm - middle_nm) < NEAR * width_nm
    kept = np.where(is_seen | is_near, np.maximum(rate, 0.0), 0.0)
    over_lamp = kept[is_lit] / of_lamp[is_lit]
    value = over_lamp * lamp.at(grid_nm[is_lit])
    return ExcitingLight(Spectrum(name, grid_nm[is_lit], value), READING_SIGMA, READING_NM)


def _mean_rate(
    records: Sequence[SpectrumRecord], dark: Mapping[float, SpectrometerReading]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return wavelengths in nm, and the mean of smoothed counts per second over readings and σ.

    `dark` are readings with the lights off, by integration time in seconds.
    """
    spectra = [
        read_spectrometer_reading(record.path).corrected(dark.get(record.integration_s))
        for record in records
    ]
    mean = np.mean([one.counts / one.integration_s for one in spectra], axis=0)
    variance = np.mean(
        [np.square(one.sigma / one.integration_s) for one in spectra if one.sigma is not None],
        axis=0,
    )
    smooth = np.full(SMOOTHED, 1 / SMOOTHED)
    sigma = np.sqrt(variance / len(spectra) / SMOOTHED)
    return spectra[0].wavelength_nm, np.convolve(mean, smooth, "same"), sigma


def _through(lamp: Spectrum, passed: Transmittance) -> Spectrum:
    """Return the lamp's light behind a filter, on the wavelengths of both."""
    grid_nm = np.union1d(lamp.wavelength_nm, passed.wavelength_nm)
    return Spectrum(passed.name, grid_nm, lamp.at(grid_nm) * passed.at(grid_nm))
