"""Model of frames of a filter's strip, which each channel sees in places of its own."""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from labrig.analyse.strip import Slices, tilt_offset
from labrig.fit.spectrum import CurveError, SpectralSystem, system_through_lvf
from labrig.foundation.arrays import FloatArray
from labrig.optics import Bands, CameraResponse, Lvf, Spectrum, Strip
from labrig.reduce import SensorLayout

#: Relative uncertainty of a lamp's spectrum whose file has none.
LAMP_SIGMA = 0.01
#: Prior σ of the frame's relative brightness, uninformative.
ANY_BRIGHTNESS = 1e3


def channel_positions(layout: SensorLayout, strip: Strip, slices: Slices) -> FloatArray:
    """Return the middle of each channel's own pixels in every slice, shape (channels, positions).

    Pixels of one colour are two apart: where slices are few pixels wide, that is some nanometres.
    """
    middles = np.array([layout.middle_columns(region) for region in slices.values()]).T
    across = (strip.right[0] - strip.left[0]) * layout.width
    fraction = (middles - strip.left[0] * layout.width) / across + tilt_offset(
        strip, slices, layout
    )
    return fraction if strip.rising else 1 - fraction


def strip_system(
    lvfs: Sequence[Lvf], camera: CameraResponse, knots_nm: FloatArray
) -> SpectralSystem:
    """Return the system whose channels each see the filter in a place of their own.

    An error of the filter is common to the channels of a slice, one of a curve is the channel's.
    """
    error = CurveError()
    parts = [
        system_through_lvf(lvf, channel, knots_nm, error)
        for lvf, channel in zip(lvfs, channel_cameras(camera), strict=True)
    ]
    filter_modes = sum(
        int(np.count_nonzero(getattr(lvfs[0].sigma, parameter.name))) for parameter in fields(Bands)
    )
    curves = len(parts[0].modes) - filter_modes
    count, knots = len(parts), len(knots_nm)
    shape = (len(parts[0].design), count, knots)
    design = np.stack([part.design for part in parts], axis=1)
    modes = []
    for number, part in enumerate(parts):
        channel_modes = np.zeros((curves, *shape))
        channel_modes[:, :, number] = part.modes[:curves]
        modes.append(channel_modes)
    modes.append(np.stack([part.modes[curves:] for part in parts], axis=2))
    rows = shape[0] * count
    return SpectralSystem(
        knots_nm, design.reshape(rows, knots), np.concatenate(modes).reshape(-1, rows, knots)
    )


def channel_cameras(camera: CameraResponse) -> list[CameraResponse]:
    """Return each channel as a camera of its own."""
    return [
        CameraResponse(
            camera.name,
            camera.wavelength_nm,
            camera.sensitivity[:, [number]],
            (name,),
            None if camera.sigma is None else camera.sigma[:, [number]],
        )
        for number, name in enumerate(camera.channels)
    ]


def conditioned_on_white(
    system: SpectralSystem,
    value: FloatArray,
    sigma: FloatArray,
    light: Spectrum,
    expected: FloatArray,
) -> SpectralSystem:
    """Condition the system on a frame of a known light.

    With value = g (expected + Σ_k z_k modes_k · light) + noise, z and g normal, this is the mean
    and covariance of z given the frame.

    Parameters
    ----------
    system
        Linear model with error modes.
    value, sigma
        Values of the frame in any unit and their standard uncertainties, shape (m,); NaN where it
        clips.
    light
        Spectrum of the light that was photographed.
    expected
        Values by the system's own curves, wavelengths beyond its knots included, shape (m,).
    """
    is_finite = np.isfinite(value) & np.isfinite(sigma)
    gain = float(
        expected[is_finite] @ value[is_finite] / (expected[is_finite] @ expected[is_finite])
    )
    y, s = value[is_finite] / gain, sigma[is_finite] / gain
    mode_values = system.modes[:, is_finite] @ light.at(system.knots_nm)
    levers = np.vstack([mode_values, ANY_BRIGHTNESS * expected[is_finite]])
    noise = np.hypot(s, LAMP_SIGMA * expected[is_finite])
    whitened = levers / noise
    precision = np.eye(len(levers)) + whitened @ whitened.T
    mean = np.linalg.solve(precision, whitened @ ((y - expected[is_finite]) / noise))
    # Rows of the root of the covariance: independent again, each of unit variance.
    root = np.linalg.inv(np.linalg.cholesky(precision))[:, :-1]
    design = system.design + np.tensordot(mean[:-1], system.modes, axes=1)
    return SpectralSystem(
        system.knots_nm, np.maximum(design, 0.0), np.tensordot(root, system.modes, axes=1)
    )
