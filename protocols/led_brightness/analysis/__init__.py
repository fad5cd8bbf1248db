"""Analysis of a calibration of LEDs, from its frames and spectra to spectra and brightnesses."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from labrig.acquire import LEDS, bank_lights
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import DATA_SHEET_NM, camera_curves, card_reflectance, led_sources
from labrig.calibration import UV_NM, CalibratedLed, LedsFile, LedSource, UvScale
from labrig.fit.leds import (
    RESPONSE_CALIBRATED,
    RESPONSE_UNKNOWN,
    BrightnessFit,
    LedLightMeasured,
    ResponseError,
    centroid_nm,
    changed_spectrum,
    fit_brightness,
)
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import (
    Contradiction,
    Disturbance,
    ResultWarning,
    Undetermined,
    Unmeasured,
)
from labrig.optics import Spectrum
from labrig.protocols.led_brightness.analysis.checks import (
    Bank,
    Checked,
    check_leds,
    unseen_channels,
)
from labrig.protocols.led_brightness.analysis.readings import (
    CameraValues,
    Spectrometry,
    camera_values,
    spectrometry,
)
from labrig.protocols.led_brightness.result import (
    LedBrightnessResult,
    LedMeasured,
)
from labrig.protocols.steps.led_scenes import AGAIN, CARD
from labrig.reduce import FLICKER
from labrig.results import Measured

#: Standard uncertainty in nm of a spectrometer's wavelengths, by its makers.
SPECTROMETER_NM = 0.2
#: Relative σ of a brightness from which it counts as unknown.
LOOSE = 0.5
#: Probability by chance below which camera and spectrometer disagree.
UNLIKELY = 1e-3
#: Relative change of the first LED over the run that causes a warning.
DRIFT = 0.02
#: Relative error of the light in a band beyond noise: what its wings lose, stray light.
BAND_SIGMA = 0.003


def analyse(context: AnalysisContext) -> LedBrightnessResult:
    """Measure spectrum and brightness of every LED.

    Raises
    ------
    UsageError
        Curves of camera or card are missing in the rig file, or the spectrum of an LED.
    DataError
        Frames are missing or damaged, or no LED lit.
    """
    bank = _bank(context)
    values = camera_values(context, bank.camera)
    spectra = {
        unit: seen
        for unit in values
        if (seen := spectrometry(context, unit, unit.removeprefix(CARD))) is not None
    }
    of_cards = {
        unit.removeprefix(CARD): reading for unit, reading in values.items() if _is_card(unit)
    }
    by_led = {
        unit.removeprefix(CARD): reading for unit, reading in spectra.items() if _is_card(unit)
    }
    checked = check_leds(bank, of_cards, by_led, context.protocol.leds)
    bank, of_cards = _without_unseen(checked, bank, of_cards)
    measured = _measured(bank, of_cards, by_led, checked)
    if all(led.value is None and led.light is None for led in measured):
        reasons = "; ".join(map(str, checked.warnings))
        raise DataError(f"{context.run.folder}: no LED can be used: {reasons}")
    drift = _drift(context.protocol.shuffled()[0], values, spectra)
    return _Calibration(context, bank, of_cards, by_led, checked, measured, drift).result()


def _is_card(unit: str) -> bool:
    return unit.startswith(CARD)


def _bank(context: AnalysisContext) -> Bank:
    source = str(context.run.folder)
    exposures = led_sources(context.rig, source)
    camera = camera_curves(context.rig, context.overrides.camera)
    nominal = {name: exposure.light for name, exposure in exposures.items()}
    lights = bank_lights(context.rig, LEDS.key, source)
    sketched = frozenset(name for name, light in lights.items() if light.spectrum is None)
    sigma_nm = {name: exposure.wavelength_sigma_nm for name, exposure in exposures.items()}
    return Bank(nominal, sketched, sigma_nm, camera, card_reflectance(context.rig))


def _without_unseen(
    checked: Checked, bank: Bank, values: Mapping[str, CameraValues]
) -> tuple[Bank, dict[str, CameraValues]]:
    """Leave out channels of the camera that see nothing, unless it sees nothing at all."""
    found = unseen_channels(bank, values)
    if not found or len(found) == len(bank.camera.channels):
        return bank, dict(values)
    checked.warnings.append(
        Unmeasured(
            "channel-unseen",
            "the camera's channel {channels} sees no LED and is left out; check its curves, and "
            "the filters before the lens",
            channels=tuple(found),
        )
    )
    kept = [n for n, channel in enumerate(bank.camera.channels) if channel not in found]
    camera = replace(
        bank.camera,
        sensitivity=bank.camera.sensitivity[:, kept],
        sigma=None if bank.camera.sigma is None else bank.camera.sigma[:, kept],
        channels=tuple(bank.camera.channels[n] for n in kept),
    )
    selected = {
        name: CameraValues(card.value[kept], card.sigma[kept], card.off[kept], card.off_sigma[kept])
        for name, card in values.items()
    }
    return replace(bank, camera=camera), selected


def _measured(
    bank: Bank,
    values: Mapping[str, CameraValues],
    spectra: Mapping[str, Spectrometry],
    checked: Checked,
) -> list[LedLightMeasured]:
    """Return what counts of every LED that is not left out, in the rig file's order."""
    measured = []
    for name, nominal in bank.nominal.items():
        if name not in values or name in checked.left_out:
            continue
        led = LedLightMeasured(name, nominal, DATA_SHEET_NM, is_nominal=name in bank.sketched)
        if name not in checked.without_camera:
            seen = values[name]
            led = replace(led, value=seen.value, variance=seen.sigma**2)
        by_spectrometer = spectra.get(name)
        if by_spectrometer is not None and name not in checked.without_spectrometer:
            led = _with_spectrum(led, by_spectrometer)
        measured.append(led)
    return measured


def _with_spectrum(led: LedLightMeasured, seen: Spectrometry) -> LedLightMeasured:
    band = seen.band
    if band is None:
        return led
    # The brightness is that of the time between both readings, of which two ends are known.
    sigma = math.hypot(band.sigma / band.light, BAND_SIGMA, seen.change / math.sqrt(12))
    return replace(
        led,
        spectrum=band.spectrum,
        wavelength_sigma_nm=math.hypot(SPECTROMETER_NM, band.centroid_nm_sigma),
        is_nominal=False,
        light=band.light,
        light_sigma=sigma,
    )


def _drift(
    first: str, values: Mapping[str, CameraValues], spectra: Mapping[str, Spectrometry]
) -> Measured | None:
    """Return the relative change of the first LED from the start to the end of the run."""
    begin, end = f"{CARD}{first}", f"{AGAIN}{first}"
    bands = [spectra[unit].band for unit in (begin, end) if unit in spectra]
    if len(bands) == 2 and bands[0] is not None and bands[1] is not None:
        ratio = bands[1].light / bands[0].light
        sigma = math.hypot(*(band.sigma / band.light for band in bands if band is not None))
        return Measured(ratio - 1, ratio * sigma)
    if begin not in values or end not in values:
        return None
    seen = [values[begin], values[end]]
    if not all(card.is_seen for card in seen):
        return None
    channel = int(np.nanargmax(seen[0].value))
    before, after = (float(card.value[channel]) for card in seen)
    noise = [float(card.sigma[channel] / card.value[channel]) for card in seen]
    ratio = after / before
    return Measured(ratio - 1, ratio * math.hypot(*noise, FLICKER * math.sqrt(2)))


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Brightness by the camera and by the spectrometer alone, and their agreement."""

    by_camera: dict[str, Measured]
    by_spectrometer: dict[str, Measured]
    p_value: float
    worst: str


@dataclass(frozen=True, eq=False)
class _Calibration:
    """Result from the readings of every LED that count."""

    part: AnalysisContext
    bank: Bank
    values: Mapping[str, CameraValues]
    spectra: Mapping[str, Spectrometry]
    checked: Checked
    measured: Sequence[LedLightMeasured]
    drift: Measured | None

    def result(self) -> LedBrightnessResult:
        """Return the result."""
        response = self._response()
        fit = fit_brightness(self.measured, self.bank.camera, self.bank.card, response)
        brightness = self._brightness(fit)
        comparison = self._compared(response)
        uv_scale = self._uv_scale(brightness)
        leds = {
            led.name: self._calibrated(number, led, fit, brightness[led.name])
            for number, led in enumerate(self.measured)
        }
        calibration = LedsFile(
            leds=leds,
            scale="absolute" if self._is_absolute else "relative",
            common_sigma=fit.scale_sigma if self._is_absolute else 0.0,
            uv_scale=uv_scale,
            source=f"white reference under one LED after another, by {self._by}, with labrig",
            run=self.part.run.name,
        )
        return LedBrightnessResult(
            calibration=calibration,
            uv_scale=uv_scale,
            channels=self.bank.camera.channels,
            leds={
                led.name: self._led(led.name, leds[led.name], brightness[led.name], comparison)
                for led in self.measured
            },
            drift=self.drift,
            warnings=(*self.checked.warnings, *self._judged(brightness, comparison)),
        )

    @property
    def _is_absolute(self) -> bool:
        lit = [self.spectra[led.name] for led in self.measured if led.light is not None]
        return bool(lit) and all(seen.is_absolute for seen in lit)

    @property
    def _by(self) -> str:
        has_spectra = any(led.light is not None for led in self.measured)
        return "spectrometer and camera" if has_spectra else "the camera"

    def _response(self) -> ResponseError:
        if not self._is_absolute:
            return RESPONSE_UNKNOWN
        sigma = max(seen.response_sigma for seen in self.spectra.values())
        return replace(RESPONSE_CALIBRATED, sigma=math.hypot(RESPONSE_CALIBRATED.sigma, sigma))

    def _brightness(self, fit: BrightnessFit) -> dict[str, Measured | None]:
        """Return brightnesses on the result's scale; None where they are unknown."""
        drift = 0.0 if self.drift is None else self.drift.value / math.sqrt(12)
        relative = np.hypot(fit.sigma, drift)
        known = [
            relative[number] < LOOSE and not self._is_unseen(led)
            for number, led in enumerate(self.measured)
        ]
        log_b = fit.log_brightness
        if not self._is_absolute and any(known):
            log_b = log_b - log_b[known].max()
        unit = "W m⁻²" if self._is_absolute else ""
        return {
            led.name: Measured(math.exp(log), math.exp(log) * float(sigma), unit) if has else None
            for led, log, sigma, has in zip(
                self.measured, log_b.tolist(), relative, known, strict=True
            )
        }

    def _is_unseen(self, led: LedLightMeasured) -> bool:
        """Whether it is ultraviolet and no spectrometer saw it."""
        return led.light is None and self.bank.peak_nm(led.name) < UV_NM

    def _uv_scale(self, brightness: Mapping[str, Measured | None]) -> UvScale:
        ultraviolet = [name for name in brightness if self._peak_nm(name) < UV_NM]
        if not ultraviolet:
            return "none"
        return "unknown" if any(brightness[name] is None for name in ultraviolet) else "measured"

    def _peak_nm(self, name: str) -> float:
        seen = self.spectra.get(name)
        if seen is not None and seen.band is not None:
            return seen.band.peak_nm
        return self.bank.peak_nm(name)

    def _compared(self, response: ResponseError) -> _Comparison | None:
        """Compare both instruments where both saw an LED; None if that are fewer than two."""
        both = [led for led in self.measured if led.light is not None and led.value is not None]
        camera = fit_brightness(
            [replace(led, light=None, light_sigma=None) for led in both],
            self.bank.camera,
            self.bank.card,
        ) if len(both) > 1 else None  # fmt: skip
        if camera is None:
            return None
        rows = np.flatnonzero(np.array(camera.by_camera) & (camera.sigma < LOOSE))
        if len(rows) < 2:
            return None
        both = [both[row] for row in rows]
        light = np.array([led.light for led in both], dtype=np.float64)
        noise = np.array([led.light_sigma for led in both], dtype=np.float64)
        centre = camera.centre_nm[rows]
        distance = (centre[:, np.newaxis] - centre) / response.correlation_nm
        by_response = response.sigma**2 * np.exp(-(distance**2) / 2) + np.diag(noise**2)
        own = camera.covariance[np.ix_(rows, rows)]
        off = camera.log_brightness[rows] - np.log(light)
        covariance = own + by_response + 1e-12 * np.eye(len(rows))
        weight = np.linalg.solve(covariance, np.ones(len(rows)))
        about = np.eye(len(rows)) - np.outer(np.ones(len(rows)), weight) / weight.sum()
        left = about @ off
        chi2 = float(left @ np.linalg.solve(covariance, left))
        pulls = left / np.sqrt(np.diag(about @ covariance @ about.T))
        names = [led.name for led in both]
        top = math.log(light.max())
        camera_log = np.log(light) + left - top
        return _Comparison(
            {
                name: Measured(math.exp(log), math.exp(log) * float(sigma))
                for name, log, sigma in zip(
                    names, camera_log.tolist(), np.sqrt(np.diag(own)), strict=True
                )
            },
            {
                name: Measured(float(amount / light.max()), float(amount / light.max() * sigma))
                for name, amount, sigma in zip(names, light, noise, strict=True)
            },
            float(chdtrc(len(rows) - 1, chi2)),
            names[int(np.argmax(np.abs(pulls)))],
        )

    def _judged(
        self, brightness: Mapping[str, Measured | None], comparison: _Comparison | None
    ) -> Iterator[ResultWarning]:
        """Yield warnings of what the numbers themselves show to be amiss."""
        unseen = [led.name for led in self.measured if self._is_unseen(led)]
        if unseen:
            yield Undetermined(
                "uv-unscaled",
                "the scale below 400 nm is unknown: no camera determines how bright {leds} is; a "
                "spectrometer at the white reference would",
                leds=tuple(unseen),
            )
        loose = [name for name, known in brightness.items() if known is None and name not in unseen]
        if loose:
            yield Unmeasured(
                "light-unscaled",
                "the brightness of {leds} stays unknown: no value of the camera determines it; a "
                "spectrometer would",
                leds=tuple(loose),
            )
        if comparison is not None and comparison.p_value < UNLIKELY:
            yield Contradiction(
                "camera-disagrees",
                "camera and spectrometer disagree about the brightnesses by more than their σ (p = "
                "{p_value:.1g}), most for {leds}: are these the camera's curves, and do both see "
                "the same white reference?",
                p_value=comparison.p_value,
                leds=(comparison.worst,),
            )
        if self.drift is not None and abs(self.drift.value) > max(DRIFT, 3 * self.drift.sigma):
            yield Disturbance(
                "lamp-drifts",
                "LED '{leds}' changed by {drift:+.1%} from the start to the end of the run; σ has "
                "it, but let the bench warm up, or look for something that was moved",
                leds=(self.part.protocol.shuffled()[0],),
                drift=self.drift.value,
            )

    def _calibrated(
        self, number: int, led: LedLightMeasured, fit: BrightnessFit, brightness: Measured | None
    ) -> CalibratedLed:
        """Return spectrum and brightness of an LED for the file."""
        spectrum, sigma_nm = self._spectrum(number, led, fit, brightness is not None)
        source: LedSource = "camera" if brightness is not None else "rig file"
        if led.light is not None:
            source = "spectrometer"
        top = spectrum.value.max()
        sigma = None if spectrum.sigma is None else tuple((spectrum.sigma / top).tolist())
        return CalibratedLed(
            wavelength_nm=tuple(spectrum.wavelength_nm.tolist()),
            value=tuple((spectrum.value / top).tolist()),
            sigma=sigma if led.light is not None else None,
            brightness=None if brightness is None else brightness.value,
            brightness_sigma=None if brightness is None else brightness.sigma,
            wavelength_sigma_nm=sigma_nm,
            source=source,
        )

    def _spectrum(
        self, number: int, led: LedLightMeasured, fit: BrightnessFit, is_known: bool
    ) -> tuple[Spectrum, float]:
        """Return an LED's spectrum, and σ of its wavelengths in nm.

        One from a data sheet is as the camera changes it, if the camera sees the LED well; that it
        is better known then is not said, since it is from the curves' slopes. The wavelengths of a
        spectrometer are better than what a camera says of them, but its response skews a spectrum.
        """
        if led.light is None and not is_known:
            return led.spectrum, self.bank.sheet_sigma_nm[led.name]
        if led.light is None:
            shifted = changed_spectrum(
                led.spectrum,
                float(fit.shift_nm[number]),
                float(fit.width_factor[number]),
                float(fit.skew[number]),
            )
            return shifted, self.bank.sheet_sigma_nm[led.name]
        spectrum = led.spectrum
        if self._is_absolute:
            return spectrum, led.wavelength_sigma_nm
        weight = np.maximum(spectrum.value, 0.0)
        off_nm = spectrum.wavelength_nm - centroid_nm(spectrum)
        skew_nm = float(weight @ off_nm**2 / weight.sum() * fit.response_slope_sigma_per_nm[number])
        levelled = _levelled(spectrum, fit.log_response_at(spectrum.wavelength_nm))
        return levelled, math.hypot(led.wavelength_sigma_nm, skew_nm)

    def _led(
        self,
        name: str,
        calibrated: CalibratedLed,
        brightness: Measured | None,
        comparison: _Comparison | None,
    ) -> LedMeasured:
        nominal, seen = self.bank.nominal[name], self.spectra.get(name)
        values = self.values[name]
        return LedMeasured(
            named_peak_nm=self.bank.peak_nm(name),
            centroid_nm=centroid_nm(calibrated.spectrum(name)),
            nominal_nm=nominal.wavelength_nm,
            nominal=nominal.value / nominal.value.max(),
            brightness=brightness,
            by_camera=None if comparison is None else comparison.by_camera.get(name),
            by_spectrometer=None if comparison is None else comparison.by_spectrometer.get(name),
            value_dn_per_s=values.value,
            sigma_dn_per_s=values.sigma,
            change=None if seen is None or seen.band is None else seen.change,
        )


def _levelled(spectrum: Spectrum, log_response: FloatArray) -> Spectrum:
    """Return a spectrum without the spectrometer's response."""
    factor = np.exp(-log_response)
    sigma = None if spectrum.sigma is None else spectrum.sigma * factor
    return replace(spectrum, value=spectrum.value * factor, sigma=sigma)
