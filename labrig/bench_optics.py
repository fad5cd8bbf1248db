"""Optical data named under `optics:` in a rig file: measured curves and calibrations."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import BaseModel

from labrig import material
from labrig.acquire import ILLUMINANTS, LEDS, RigFile, bank_lights
from labrig.calibration import CalibrationKind, LedsFile, LvfFile, kinds
from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import did_you_mean
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Transmittance,
    photopic_efficacy,
    quadrature,
    read_camera,
    read_spectrum,
    read_transmittance,
    shipped_camera,
)

FileT = TypeVar("FileT", bound=BaseModel)

#: Wavelengths in nm between which all that is before a camera has to be known.
SEEN_NM = (400.0, 700.0)
#: Wavelengths in nm over which luminances are integrated.
VISIBLE_NM = (360.0, 830.0)
#: Standard uncertainty in nm of the peak of an LED by its data sheet: makers sort them to 2–5 nm.
DATA_SHEET_NM = 2.0
#: Distance of an LED's centroid from its peak, in widths at half maximum (1 σ): blue and green ones
#: are wider on the red side, red ones on the blue side, by a third.
SKEW_SHARE = 0.14


@dataclass(frozen=True, eq=False)
class LightSource:
    """An LED, or another lamp, as a light for a fit.

    Attributes
    ----------
    light
        Its spectrum, on any scale.
    brightness, brightness_sigma
        Brightness b on a scale common to all LEDs, and σ; b is 1 and σ infinite where unknown.
    wavelength_sigma_nm
        Standard uncertainty in nm of an error that all wavelengths have in common.
    is_nominal
        Whether the spectrum is a curve by peak and width from a data sheet.
    is_lamp
        Whether it is a broadband lamp, whose spectrum is that of another one of its kind.
    """

    light: Spectrum
    brightness: float
    brightness_sigma: float
    wavelength_sigma_nm: float
    is_nominal: bool = False
    is_lamp: bool = False


def camera_curves(
    rig: RigFile, instead: str | None = None, lvf: LvfFile | None = None
) -> CameraResponse:
    """Read the camera's curves: those of `instead`, of a filter's calibration, or of the rig.

    The order is one of precedence. A filter's calibration determines the product of filter and
    camera, so light read through the filter takes both from it; it has also measured this body, not
    another one of its model. Other curves are multiplied by the transmittances of lens and
    polariser that the rig file names.

    Raises
    ------
    UsageError
        No curves are named, or there are none of that name.
    """
    if instead is None and lvf is not None and lvf.camera is not None:
        calibrated = lvf.camera.response()
        return replace(
            calibrated, name=f"{calibrated.name}, as the filter's calibration found them"
        )
    camera = read_camera(instead or _named(rig.optics.camera, "camera"))
    passed = np.ones_like(camera.wavelength_nm)
    for part in (lens_transmittance(rig), polariser_transmittance(rig)):
        if part is not None:
            passed = passed * part.at(camera.wavelength_nm)
    seen = passed[:, np.newaxis] * camera.sensitivity
    if not (seen.max(axis=0) > 0).all():
        raise UsageError(
            f"{camera.name}: expected channels that see through lens and polariser, got one that "
            "sees nothing; check 'lens' and 'polariser' under 'optics:'"
        )
    sigma = None if camera.sigma is None else passed[:, np.newaxis] * camera.sigma / seen.max()
    return replace(camera, sensitivity=seen / seen.max(), sigma=sigma)


def with_shipped_camera(rig: RigFile, identity: str) -> RigFile:
    """Return the rig with the shipped curves of its camera, where the rig file names none.

    Parameters
    ----------
    rig
        The rig.
    identity
        What the camera says of itself: maker and model, then serial number and firmware.

    Returns
    -------
    RigFile
        The rig itself if it names curves, none of that model are shipped, or the ratios between
        the channels of those are unknown.
    """
    shipped = shipped_camera(identity.partition(",")[0])
    if rig.optics.camera is not None or shipped is None or not read_camera(shipped.path).has_ratios:
        return rig
    return rig.model_copy(update={"optics": rig.optics.model_copy(update={"camera": shipped.name})})


def lens_transmittance(rig: RigFile) -> Transmittance | None:
    """Read the transmittance of the camera's lens; None if it is in the camera's curves."""
    named = rig.optics.lens
    return None if named is None else _passing(resources.curve_path(named), "lens")


def polariser_transmittance(rig: RigFile) -> Transmittance | None:
    """Read the transmittance of one polariser; None if it is even, or there are none."""
    named = rig.optics.polariser
    return None if named is None else _passing(resources.curve_path(named), "polariser")


def _passing(path: Path, key: str) -> Transmittance:
    """Read the curve of something before a camera, which has to be known where the camera sees."""
    curve = read_transmittance(path)
    low_nm, high_nm = curve.wavelength_nm[[0, -1]]
    if low_nm > SEEN_NM[0] or high_nm < SEEN_NM[1]:
        raise UsageError(
            f"{path}: expected the transmittance of the {key} from {SEEN_NM[0]:g} nm to "
            f"{SEEN_NM[1]:g} nm, got {low_nm:g} nm to {high_nm:g} nm"
        )
    return curve


def calibration(rig: RigFile, kind: CalibrationKind[FileT]) -> FileT | None:
    """Read the calibration of that kind named in the rig file; None if none is named.

    Raises
    ------
    UsageError
        The file is missing or malformed.
    """
    named = rig.optics.named(kind)
    return None if named is None else kind.read(Path(named))


def lamp_spectrum(rig: RigFile) -> Spectrum:
    """Read the relative spectrum of the rig's lamp."""
    return read_spectrum(resources.curve_path(_named(rig.optics.lamp, "lamp")))


def card_reflectance(rig: RigFile) -> Transmittance:
    """Read the reflectance of the rig's grey card."""
    return read_transmittance(resources.curve_path(_named(rig.optics.grey_card, "grey_card")))


def bare_lamp_spectrum(rig: RigFile) -> Spectrum:
    """Read the lamp's spectrum that belongs to the reading `optics.luminance`."""
    reading = rig.optics.luminance
    named = None if reading is None else reading.spectrum
    return lamp_spectrum(rig) if named is None else read_spectrum(resources.curve_path(named))


def card_radiance(rig: RigFile) -> Spectrum:
    """Return the spectral radiance of the grey card under the bare lamp in W m⁻² sr⁻¹ nm⁻¹.

    It is ρ E/π, and its luminance that of the reading `optics.luminance`.

    Raises
    ------
    UsageError
        There is no reading, or a curve is missing.
    """
    reading = rig.optics.luminance
    if reading is None:
        raise UsageError(
            f"rig '{rig.name}': expected a reading of a luxmeter or luminance meter; add under "
            "'optics:' luminance: {value: 312 lx, sigma: 3 %, at: sample plane, lamp: halogen}"
        )
    lamp, card = bare_lamp_spectrum(rig), card_reflectance(rig)
    grid_nm = np.union1d(np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1), lamp.wavelength_nm)
    reflected = lamp.at(grid_nm) * card.at(grid_nm)
    on_card = reading.at == "card"
    seen = luminance(Spectrum(lamp.name, grid_nm, reflected if on_card else lamp.at(grid_nm)))
    if seen <= 0:
        raise UsageError(f"{lamp.name}: expected a lamp with visible light, got none")
    scale = reading.number / seen / (1.0 if on_card else math.pi)
    return Spectrum("grey card under the bare lamp", grid_nm, scale * reflected)


def illuminance_lx(rig: RigFile) -> float:
    """Return the illuminance of the sample under the bare lamp in lx, by `optics.luminance`.

    Raises
    ------
    UsageError
        There is no reading, or a curve is missing.
    """
    lit, card, lamp = card_radiance(rig), card_reflectance(rig), bare_lamp_spectrum(rig)
    relative = luminance(replace(lit, value=lamp.at(lit.wavelength_nm)))
    reflected = lamp.at(lit.wavelength_nm) * card.at(lit.wavelength_nm)
    # The same factor leads from the lamp's curve to the irradiance at all wavelengths.
    return math.pi * relative * luminance(lit) / luminance(replace(lit, value=reflected))


def luminance(spectrum: Spectrum) -> float:
    """Return the luminance in cd/m² of a spectral radiance in W m⁻² sr⁻¹ nm⁻¹."""
    nodes, weights = quadrature(*VISIBLE_NM, spectrum.wavelength_nm)
    return float(weights @ (spectrum.at(nodes) * photopic_efficacy(nodes)))


def filter_transmittances(rig: RigFile, names: Sequence[str]) -> list[Transmittance]:
    """Read the transmittances of colour filters, in the order of `names`.

    Raises
    ------
    UsageError
        There is no file of that name in the rig's folder.
    """
    files = rig.optics.filter_files()
    if unknown := [name for name in names if name not in files]:
        raise UsageError(
            f"{next(iter(files.values())).parent}: no file for the colour filter '{unknown[0]}'; "
            f"{did_you_mean(unknown[0], list(files))}"
        )
    return [read_transmittance(files[name]) for name in names]


def led_sources(
    rig: RigFile, source: str, calibration: LedsFile | None = None
) -> dict[str, LightSource]:
    """Return spectrum and brightness of each LED of a rig: as calibrated, else by the rig file.

    An LED that the calibration left out has the rig file's spectrum, through the polariser if there
    is one, and no known brightness.

    Parameters
    ----------
    rig, source
        Rig file, and its name or path for messages.
    calibration
        Calibration of the LEDs; None if there is none.

    Raises
    ------
    UsageError
        The rig has no LEDs, nothing is known of the light of one, or the calibration is of other
        LEDs.
    """
    lights = bank_lights(rig, LEDS.key, source)
    if not lights:
        raise UsageError(f"{source}: expected LEDs under 'devices', found none")
    calibrated = {} if calibration is None else calibration.leds
    if others := [name for name in calibrated if name not in lights]:
        raise UsageError(
            f"{source}: the calibration of the LEDs has '{others[0]}', the rig has "
            f"{', '.join(lights)}; run led_brightness on this rig, and name its run (optics: leds)"
        )
    exposures, polariser = {}, polariser_transmittance(rig)
    for name, light in lights.items():
        led = calibrated.get(name)
        if led is not None:
            known = led.brightness is not None and led.brightness_sigma is not None
            exposures[name] = LightSource(
                led.spectrum(name),
                led.brightness if led.brightness is not None and known else 1.0,
                led.brightness_sigma if led.brightness_sigma is not None and known else math.inf,
                led.wavelength_sigma_nm,
            )
            continue
        spectrum = light.relative_spectrum()
        if spectrum is None:
            raise UsageError(
                f"{source}: nothing is known of the light of LED '{name}'; give its 'centre' and "
                "'fwhm', or a file 'spectrum'"
            )
        if polariser is not None:
            passed = spectrum.value * polariser.at(spectrum.wavelength_nm)
            spectrum = replace(spectrum, value=passed, sigma=None)
        sigma_nm = math.hypot(DATA_SHEET_NM, SKEW_SHARE * (light.fwhm or 0.0))
        exposures[name] = LightSource(
            replace(spectrum, name=name), 1.0, math.inf, sigma_nm, light.spectrum is None
        )
    return exposures


def illuminant_sources(rig: RigFile, source: str) -> dict[str, LightSource]:
    """Return the light of each lamp of a rig's bank behind its filter, of unknown brightness.

    Parameters
    ----------
    rig, source
        Rig file, and its name or path for messages.

    Raises
    ------
    UsageError
        The rig has no bank of lamps, nothing is known of the light of one, or its filter is
        unknown.
    """
    lamps = bank_lights(rig, ILLUMINANTS.key, source)
    if not lamps:
        raise UsageError(f"{source}: expected 'illuminants' under 'devices', found none")
    exposures = {}
    for name, lamp in lamps.items():
        spectrum = lamp.relative_spectrum()
        if spectrum is None:
            raise UsageError(
                f"{source}: nothing is known of the light of lamp '{name}'; give its 'spectrum', "
                "or its 'centre' and 'fwhm'"
            )
        if lamp.filter is not None:
            (passed,) = filter_transmittances(rig, [lamp.filter])
            spectrum = replace(spectrum, value=spectrum.value * passed.at(spectrum.wavelength_nm))
        sigma_nm = math.hypot(DATA_SHEET_NM, SKEW_SHARE * lamp.fwhm) if lamp.fwhm else 0.0
        exposures[name] = LightSource(
            replace(spectrum, name=name),
            1.0,
            math.inf,
            sigma_nm,
            is_nominal=lamp.spectrum is None,
            is_lamp=True,
        )
    return exposures


def require_optics(rig: RigFile) -> None:
    """Read all that a rig file names under `optics:`, since a run needs it hours later only.

    Raises
    ------
    UsageError
        A file is missing or malformed, or there is none of that name.
    """
    lens_transmittance(rig)
    polariser_transmittance(rig)
    if rig.optics.camera is not None:
        camera_curves(rig)
    if rig.optics.lamp is not None:
        lamp_spectrum(rig)
    if rig.optics.grey_card is not None:
        card_reflectance(rig)
    if rig.optics.luminance is not None:
        card_radiance(rig)
    if rig.optics.filters is not None:
        rig.optics.filter_files()
    if rig.optics.emission_library is not None:
        # Not by its name above: it needs SciPy, which no plan of a run should wait for.
        material.read_emissions(rig.optics.emission_library)
    for kind in kinds():
        calibration(rig, kind)


def _named(value: str | None, key: str) -> str:
    if value is None:
        raise UsageError(
            f"the rig file does not say which {key.replace('_', ' ')} it has; name its curve under "
            f"'optics:', such as '{key}: ./my-{key.replace('_', '-')}.csv'"
        )
    return value
