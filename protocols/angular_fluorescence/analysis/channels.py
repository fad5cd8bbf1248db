"""Channels of the camera that see re-radiated light, and how much reflected light is among it."""

from collections.abc import Mapping, Sequence

import numpy as np

from labrig.acquire import LEDS, RigFile, bank_lights
from labrig.bench_optics import camera_curves
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError

#: Largest fraction of reflected light in a channel that is chosen.
MAX_REFLECTED = 0.05
#: Response to an LED over that at a channel's peak below which a camera does not see the LED.
_INVISIBLE = 1e-3
#: Part of its light in the channel that sees an LED best which is reflected, and its σ: the rest
#: is re-radiated.
PART, PART_SIGMA = 0.75, 0.35
#: Error of a camera's curves far from their peaks, over the response of the best channel.
FOOT_SIGMA = 0.02


def led_response(
    rig: RigFile, led: str, channels: Sequence[str], instead: str | None
) -> FloatArray | None:
    """Return the camera's relative response to an LED's own light, shape (channels,).

    It is 0 of an LED that the camera does not see, and None if the rig file does not say the
    curves of camera and LED.
    """
    light = bank_lights(rig, LEDS.key, "rig.yaml").get(led)
    spectrum = None if light is None else light.relative_spectrum()
    if spectrum is None or (rig.optics.camera is None and instead is None):
        return None
    camera = camera_curves(rig, instead)
    if tuple(camera.channels) != tuple(channels):
        return None
    total = spectrum.value.sum()
    response = spectrum.value @ camera.at(spectrum.wavelength_nm) / total
    seen = response / camera.sensitivity.max(axis=0)
    return np.where(seen.max() > _INVISIBLE, response, 0.0)


def reflected_at_most(signal: FloatArray, response: FloatArray | None) -> FloatArray:
    """Return an upper limit of the reflected part of each channel's signal, shape (channels,).

    The channel that sees the LED best is taken to see nothing else.
    """
    if response is None:
        return np.full_like(signal, np.nan)
    if not response.any():
        return np.zeros_like(signal)
    best = int(np.argmax(response))
    limit = response / response[best] * signal[best] / np.maximum(signal, 1e-30)
    return np.asarray(np.minimum(limit, 1.0))


def chosen_channels(
    wanted: Sequence[str] | None,
    channels: Sequence[str],
    part: str,
    limits: FloatArray,
    response: FloatArray | None,
) -> list[int]:
    """Return the numbers of the channels whose sum is the signal.

    Raises
    ------
    UsageError
        A channel does not exist, or cannot be chosen for want of curves.
    """
    if part == "reflected":
        if response is None or not response.any():
            raise UsageError(
                "reflected_led: expected an LED that the camera sees, with centre and fwhm in the "
                "rig file and the camera's curves in its optics:"
            )
        return [int(np.argmax(response))]
    if wanted is not None:
        unknown = [name for name in wanted if name not in channels]
        if unknown:
            raise UsageError(
                f"channels: expected some of {', '.join(channels)}, got {', '.join(unknown)}"
            )
        return [channels.index(name) for name in wanted]
    if np.isnan(limits).any():
        raise UsageError(
            "expected 'channels' in the protocol, for example [R], or centre and fwhm of the LED "
            "and the camera's curves in the rig file, from which they follow"
        )
    return [n for n, limit in enumerate(limits) if limit <= MAX_REFLECTED] or [
        int(np.argmin(limits))
    ]


def reflected_signal(
    values: FloatArray, response: FloatArray | None, chosen: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return the reflected light in a sum of channels, and its σ, which all values share.

    The channel that sees the LED best tells how much of its light is reflected, or more.

    Parameters
    ----------
    values
        Values of all channels, shape (..., channels).
    response
        Response of the channels to the LED, shape (channels,); None if unknown, and nothing is
        subtracted.
    chosen
        Numbers of the channels of the sum.

    Returns
    -------
    tuple of ndarray
        Both in the unit of the values, shape (...).
    """
    if response is None or not response.any():
        return np.zeros(values.shape[:-1]), np.zeros(values.shape[:-1])
    best = int(np.argmax(response))
    part = float(response[list(chosen)].sum() / response[best])
    sigma = np.hypot(PART_SIGMA * part, len(chosen) * FOOT_SIGMA)
    return PART * part * values[..., best], sigma * values[..., best]


def mixed_limit(signal: FloatArray, limits: FloatArray, chosen: Sequence[int]) -> float:
    """Return the upper limit of the reflected part of a sum of channels."""
    used = list(chosen)
    return float((limits[used] * signal[used]).sum() / signal[used].sum())


def grouped(names: Sequence[str]) -> Mapping[str, list[int]]:
    """Return the places of each name, in the order of their first appearance."""
    places: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        places.setdefault(name, []).append(place)
    return places
