"""Brightness of a sample: measured on this bench, or derived from its metered exposure."""

from collections.abc import Mapping

import numpy as np

from labrig.acquire import CameraOffers
from labrig.foundation.errors import UsageError
from labrig.material import Material
from labrig.optics import CameraResponse
from labrig.predict.camera import CameraFigures
from labrig.predict.expectation import Bench, expected_schedule
from labrig.predict.glow import Glow, laws, measured_amplitudes, radiated
from labrig.predict.reference import Reference
from labrig.protocols.steps.decays import DecaySettings

#: Range of the bisection in DN/s, and number of its steps.
DIMMEST, BRIGHTEST = 1e-3, 1e9
BISECTIONS = 50
#: Half a step of exposure times, in thirds of a stop: middle of brightnesses metered alike.
HALF_A_THIRD_STOP = 2 ** (1 / 6)


def measured_glow(
    material: Material, protocol: DecaySettings, reference: Reference | None
) -> Glow | None:
    """Return the glow of a material that the reference run measured; None for others."""
    amplitude = measured_amplitudes(material)
    if reference is None or amplitude is None:
        return None
    return Glow(
        *laws(material, _charge_s(protocol)),
        amplitude,
        reference.channel_weights,
        reference.camera.iso,
        reference.f_number,
    )


def relative_glow(
    material: Material,
    protocol: DecaySettings,
    camera: CameraFigures,
    response: CameraResponse | None,
) -> Glow:
    """Return the glow of a material with a total brightness of 1.

    Raises
    ------
    UsageError
        If the relative strengths of its states are not known.
    """
    charge_s = _charge_s(protocol)
    weights: Mapping[str, float] = {}
    amplitude = measured_amplitudes(material)
    if amplitude is None and len(material.states) == 1:
        amplitude = np.ones(1)
    if (radiation := radiated(material, response, charge_s)) is not None:
        amplitude, weights = radiation
    if amplitude is None or not amplitude.sum() > 0:
        raise UsageError(
            f"{material.name}: expected 'amplitude' or 'reradiation' of every state, to know how "
            "strong they are relative to each other, got neither"
        )
    if set(weights) != set(camera.channel_fractions):
        # Of an unknown colour only the channel with most pixels is counted on.
        weights = {
            max(camera.channel_fractions, key=lambda name: camera.channel_fractions[name]): 1.0
        }
    settings = protocol.camera
    return Glow(
        *laws(material, charge_s),
        amplitude / amplitude.sum(),
        weights,
        settings.iso,
        settings.f_number,
    )


def _charge_s(protocol: DecaySettings) -> float:
    """Return the length of the charge in seconds, infinite up to the plateau."""
    return protocol.charge if isinstance(protocol.charge, float) else np.inf


def brightness_metered_as(
    metered: DecaySettings, offers: CameraOffers, bench: Bench, exposure_s: float
) -> float:
    """Return the factor for the glows with which metering chooses a given first exposure.

    Parameters
    ----------
    classify_ladder
        Protocol with `exposure: auto`.
    offers
        Settings that the camera offers.
    bench
        Bench with the glows to be scaled.
    exposure_s
        First exposure time in seconds; if the time between frames does not allow it, the glow is
        dimmer in proportion.
    """
    reached_s = min(exposure_s, metered.longest_exposure_s(offers))
    metered_bench = bench.at_settings(metered.camera)
    low, high = np.log(DIMMEST), np.log(BRIGHTEST)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        brighter = {
            patch: glow.brighter(np.exp(middle)) for patch, glow in metered_bench.glows.items()
        }
        trial_bench = Bench(metered_bench.camera, metered_bench.flicker, brighter)
        schedule = expected_schedule(metered, offers, trial_bench, lambda _: None)
        low, high = (
            (middle, high) if schedule.exposures_s[0] >= 0.999 * reached_s else (low, middle)
        )
    return float(np.exp(low)) / HALF_A_THIRD_STOP * reached_s / exposure_s
