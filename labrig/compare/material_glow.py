"""The glow that a material file predicts for each photograph of a series."""

import numpy as np

from labrig.compare.colorimetry import FloatArray
from labrig.compare.paper import emission
from labrig.errors import UsageError
from labrig.material import Material, phi1
from labrig.optics import CameraResponse, Spectrum
from labrig.results import Series


def in_colour(values: FloatArray, spectrum: Spectrum, camera: CameraResponse) -> FloatArray:
    """`values`, (n, 3), with the colour that `camera` sees of `spectrum`; as bright as they are."""
    colour = camera.response(spectrum.resampled(camera.wavelength_nm).value)
    brightness = values @ colour / (colour @ colour)
    return np.asarray(np.multiply.outer(brightness, colour))


def glow_of(material: Material, series: Series, camera: CameraResponse | None) -> FloatArray:
    """Mean over each exposure, (n, 3), on the scale of `series`.

    Rates and shares of the states are the material's: its amplitudes, else Λ_i k_r,i r_i(0) with
    r_i(0) = 1 where it is not known. All states have one colour, that of its spectrum or, where
    spectrum or camera are not known, the mean colour of the photographs. One factor is found by
    least squares.

    Raises
    ------
    UsageError
        The material's file has neither amplitudes nor Λ.
    """
    rates = np.array([state.k_r_per_s for state in material.states])
    means = np.exp(-np.multiply.outer(series.t_s, rates)) * phi1(
        np.multiply.outer(series.exposure_s, rates)
    )
    signal = means @ _amplitudes(material)
    spectrum = emission(material)
    glow = np.multiply.outer(signal, signal @ series.values)
    if spectrum is not None and camera is not None:
        glow = in_colour(glow, spectrum, camera)
    return np.asarray(glow * (np.sum(glow * series.values) / np.sum(glow**2)))


def _amplitudes(material: Material) -> FloatArray:
    """Relative, (m,)."""
    amplitudes = [state.amplitude for state in material.states]
    if all(amplitude is not None for amplitude in amplitudes):
        return np.array(amplitudes, dtype=np.float64)
    if material.bands_nm is None or any(state.reradiation is None for state in material.states):
        raise UsageError(
            f"{material.name}: expected amplitudes or reradiation in every state, got neither; "
            "there is no glow to predict"
        )
    widths = np.diff(material.bands_nm)
    return np.array(
        [
            float(np.array(state.reradiation) @ widths)
            * state.k_r_per_s
            * (1.0 if state.r0 is None else state.r0)
            for state in material.states
        ]
    )
