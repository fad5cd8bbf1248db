"""Radiometric scale of a glow: from counts to radiance, by a grey card under the lamp.

The card's radiance is ρ E/π, in the counts of the same camera. A glow of a known spectrum has the
radiance per nm at its peak that its counts in a channel tell, relative to the lamp's mean spectral
irradiance over the bands; with a reading in lux, in W m⁻² sr⁻¹ nm⁻¹ (Nalbach et al., eq. 1 and 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import camera_curves, card_reflectance, lamp_spectrum
from labrig.calibration import (
    CAMERA_KIND,
    LVF_KIND,
    CardLight,
    IrradianceFile,
    relative_sensitivity,
)
from labrig.fit.spectrum import CurveError, camera_modes
from labrig.foundation.errors import UsageError
from labrig.material import SEEN_FACTOR, Material, ScaleFactor, State
from labrig.optics import (
    CameraResponse,
    Spectrum,
    Transmittance,
    absolute_irradiance,
    band_integrals,
    quadrature,
)
from labrig.results import EmissionSpectrum

#: Unit of the radiance per nm on either scale.
SCALE_UNITS = {"relative": "1/sr", "absolute": "W/(m2 sr nm)"}
#: Relative σ of a card's curve that has none.
CARD_SIGMA = 0.01


@dataclass(frozen=True)
class RadiometricScale:
    """Factor from counts in one channel to radiance at the emission's peak.

    Attributes
    ----------
    kind
        `relative`: over the lamp's mean spectral irradiance, in sr⁻¹; `absolute`: in
        W m⁻² sr⁻¹ nm⁻¹.
    factors
        Factors in order; their product is that of the scale.
    """

    kind: str
    factors: tuple[ScaleFactor, ...]

    @property
    def value(self) -> float:
        """Radiance per DN/s."""
        return float(np.prod([factor.value for factor in self.factors]))

    @property
    def relative_sigma(self) -> float:
        """Relative σ of `value`."""
        parts = [(factor.sigma or 0.0) / factor.value for factor in self.factors]
        return float(np.linalg.norm(parts))

    def of(self, material: Material) -> Material:
        """Return the material with amplitudes and Λ on this scale, whose σ is in theirs."""
        states = tuple(self._scaled(state) for state in material.states)
        return material.model_copy(
            update={"states": states, "scale": self.kind, "scale_factors": self.factors}
        )

    def _scaled(self, state: State) -> State:
        changed: dict[str, Any] = {"amplitude_unit": SCALE_UNITS[self.kind]}
        for name in ("amplitude", "reradiation"):
            value, sigma = getattr(state, name), getattr(state, f"{name}_sigma")
            if value is None:
                continue
            number = np.array(value) * self.value
            changed[name] = _plain(number)
            ends = getattr(state, f"{name}_range", None)
            if ends is not None:
                changed[f"{name}_range"] = tuple(_plain(np.array(end) * self.value) for end in ends)
            if sigma is not None:
                total = np.hypot(np.array(sigma) * self.value, number * self.relative_sigma)
                changed[f"{name}_sigma"] = _plain(total)
        return state.model_copy(update=changed)


def radiometric_scale(
    context: AnalysisContext,
    irradiance: IrradianceFile,
    spectrum: EmissionSpectrum,
    channel: str,
    iso: float,
    f_number: float | None,
) -> RadiometricScale | None:
    """Return the scale of a glow's counts in a channel; None where the bench does not tell it.

    Parameters
    ----------
    part
        Part of a run, whose rig file names the curves of camera, lamp and grey card.
    irradiance
        Irradiance file with the card's light.
    spectrum
        Emission spectrum of the glow.
    channel
        Name of the channel in which the counts are.
    iso, f_number
        Settings to which the counts belong.
    """
    card = irradiance.card
    optics = context.rig.optics
    if card is None or channel not in card.channels or optics.lamp is None:
        return None
    if optics.grey_card is None:
        return None
    try:
        camera = camera_curves(context.rig, context.overrides.camera, context.inputs[LVF_KIND])
    except UsageError:
        return None
    if channel not in camera.channels:
        return None
    lamp, grey = lamp_spectrum(context.rig), card_reflectance(context.rig)
    relative = scale_of(
        card,
        camera,
        channel,
        lamp,
        grey,
        Spectrum("glow", np.array(spectrum.wavelength_nm), np.array(spectrum.value)),
        irradiance.bands_nm,
    )
    factors = (_settings(context, card, iso, f_number), *relative)
    lux, lux_sigma = irradiance.illuminance_lux, irradiance.illuminance_lux_sigma
    if lux is None:
        return RadiometricScale("relative", factors)
    return RadiometricScale(
        "absolute", (*factors, mean_irradiance(lux, lux_sigma or 0.0, lamp, irradiance.bands_nm))
    )


def scale_of(
    card: CardLight,
    camera: CameraResponse,
    channel: str,
    lamp: Spectrum,
    grey: Transmittance,
    glow: Spectrum,
    bands_nm: Sequence[float],
) -> tuple[ScaleFactor, ...]:
    """Return the factors from counts of a glow to its radiance over the lamp's mean irradiance.

    Parameters
    ----------
    card
        Counts of the card under the lamp.
    camera, channel
        Curves of the camera, and the channel in which the counts are.
    lamp
        Relative spectrum of the lamp.
    grey
        Reflectance of the card.
    glow
        Relative spectrum of the glow, its maximum 1.
    bands_nm
        Edges of the bands over which the lamp's irradiance is averaged, in nm.
    """
    column = camera.channels.index(channel)
    low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
    nodes, weights = quadrature(low, high, camera.wavelength_nm, lamp.wavelength_nm)
    sensitivity = camera.at(nodes)
    mean_lamp = float(band_integrals(lamp.wavelength_nm, lamp.value, np.array(bands_nm)).sum())
    mean_lamp /= bands_nm[-1] - bands_nm[0]
    of_card = weights * lamp.at(nodes) * grey.at(nodes) / mean_lamp
    of_glow = weights * glow.at(nodes)
    ratio = float(of_card @ sensitivity[:, column]) / float(of_glow @ sensitivity[:, column])
    modes = camera_modes(camera, nodes, CurveError())
    changes = [
        float(of_card @ mode[:, column]) / float(of_card @ sensitivity[:, column])
        - float(of_glow @ mode[:, column]) / float(of_glow @ sensitivity[:, column])
        for mode in modes
    ]
    dn_per_s = card.dn_per_s[card.channels.index(channel)]
    noise = card.sigma_dn_per_s[card.channels.index(channel)]
    card_sigma = CARD_SIGMA
    if grey.sigma is not None:
        sigma = np.interp(nodes, grey.wavelength_nm, grey.sigma)
        card_sigma = float(of_card @ (sigma / grey.at(nodes)) / of_card.sum())
    return (
        ScaleFactor(
            name="one over the card's signal under the lamp",
            value=1 / dn_per_s,
            sigma=noise / dn_per_s**2,
            unit="s/DN",
        ),
        ScaleFactor(
            name=SEEN_FACTOR,
            value=ratio,
            sigma=ratio * float(np.hypot(np.linalg.norm(changes), card_sigma)),
            unit="1",
        ),
        ScaleFactor(name="radiance of a diffuse white over irradiance, 1/π", value=1 / np.pi,
                    unit="1/sr"),
    )  # fmt: skip


def mean_irradiance(
    lux: float, lux_sigma: float, lamp: Spectrum, bands_nm: Sequence[float]
) -> ScaleFactor:
    """Return the lamp's mean spectral irradiance over the bands, by a reading in lux.

    Parameters
    ----------
    lux, lux_sigma
        Illuminance at the sample in lux, and σ.
    lamp
        Relative spectrum of the lamp.
    bands_nm
        Edges of the bands in nm.
    """
    light = absolute_irradiance(lux, lamp)
    whole = float(band_integrals(light.wavelength_nm, light.value, np.array(bands_nm)).sum())
    value = whole / (bands_nm[-1] - bands_nm[0])
    return ScaleFactor(
        name="lamp's mean spectral irradiance over the bands, by a reading in lux",
        value=value,
        sigma=value * lux_sigma / lux,
        unit="W/m²/nm",
    )


def _settings(
    context: AnalysisContext, card: CardLight, iso: float, f_number: float | None
) -> ScaleFactor:
    """Return the card's signal per that at the settings of the glow."""
    value, sigma = relative_sensitivity(
        context.inputs[CAMERA_KIND], (card.iso, card.f_number), (iso, f_number)
    )
    return ScaleFactor(
        name="card's sensitivity and aperture over those of the glow",
        value=value,
        sigma=sigma * value,
    )


def _plain(number: Any) -> Any:
    """Return an array as a tuple, and a number as one."""
    return float(number) if number.ndim == 0 else tuple(number.tolist())
