"""From light to photo-electrons: the simulated camera's curves, aperture and lens, and luminance.

The curves are the shipped ones of a Canon EOS 5D Mark II, changed smoothly by as much as three
laboratories disagree about that camera: labrig, which has the shipped ones, must tolerate it.
"""

import json
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.material import Material

from .lamp import BURNING_SPECTRUM, CELL_NM, IS_VISIBLE, WAVELENGTH_NM
from .phosphor import band_cells
from .simulation import LampSettings

CURVES = "canon_eos_5d_mark_ii"
CHANNELS = ("R", "G", "B")

#: Three published sets of this camera's curves, peak-normalised, differ by 0.02–0.06 RMS.
DISAGREEMENT_RMS = (0.022, 0.058)
#: Distance of the random knots of that difference: smooth like a wrong reference diode.
KNOTS_NM: FloatArray = np.arange(340.0, 840.0, 40.0)
#: Fraction of it that is stray light and dark error, added where the curve itself is nearly zero.
ADDED = 0.05

#: Strengths of the random difference to look up to: one of them reaches the disagreement.
STRENGTHS = (1.0, 2.0, 4.0, 8.0, 16.0)

#: Photo-electrons a second and pixel at f/1 for 1 nm of radiance 1 in Table 1's scale at
#: sensitivity 1. Chosen: blue paint just after a long charge fills half of the range at ISO 400,
#: f/4, 1 s.
ELECTRONS_PER_S_NM = 33_000.0
#: Radiance that a white surface reflects at irradiance 1. Chosen: under the default lamp a grey
#: card fills half of the range at ISO 100, f/5.6, 1/60 s, about 500 times the glow of blue paint.
REFLECTED = 12.5
#: Reflectance of the black cloth around the samples.
CLOTH_REFLECTANCE = 0.03

#: Distance in nm over which a lens's glass absorbs e times less: an exponential edge (Urbach's).
GLASS_EDGE_NM = 6.0
#: Polariser of iodine in stretched film: part of unpolarised, or depolarised, light that it passes,
#: wavelength of the half of that, and width of the edge in nm.
FILM, FILM_EDGE_NM, FILM_WIDTH_NM = 0.4, 395.0, 7.0

#: From the middle to the corner of a full-format frame, and the lens that a camera usually has.
CORNER_MM = 21.75
FOCAL_MM = 75.0


@dataclass(frozen=True)
class CameraCurves:
    """Spectral sensitivity, shape (3, wavelengths) on `WAVELENGTH_NM`, relative; rows R, G, B."""

    sensitivity: FloatArray

    def glow_electrons_per_s(self, emission: FloatArray, f_number: float) -> FloatArray:
        """Return electrons per second of spectra (…, wavelengths) in Table 1's scale, (…, 3)."""
        rate: FloatArray = (
            ELECTRONS_PER_S_NM / f_number**2 * CELL_NM * (emission @ self.sensitivity.T)
        )
        return rate

    def reflected_electrons(self, lamp_exposure: FloatArray, f_number: float) -> FloatArray:
        """Return electrons of a white surface under ∫ irradiance dt (wavelengths,), shape (3,)."""
        return self.glow_electrons_per_s(REFLECTED * lamp_exposure, f_number)


def measured_curves(name_or_path: str = CURVES) -> CameraCurves:
    """Return a camera's measured curves on the simulator's grid; 0 beyond the measurement.

    Parameters
    ----------
    name_or_path
        Shipped name, or a file in rawtoaces' format.

    Raises
    ------
    UsageError
        There is no such file, or it has another format.
    """
    path = resources.find("config/optics/cameras", "camera", name_or_path)
    try:
        table = json.loads(read_text(path, MAX_JSON_BYTES))["spectral_data"]["data"]["main"]
        wavelength_nm = np.array([float(key) for key in table])
        values = np.array(list(table.values()), dtype=np.float64).reshape(-1, len(CHANNELS))
        curves = PchipInterpolator(wavelength_nm, values, extrapolate=False)(WAVELENGTH_NM).T
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(
            f"{path}: expected camera curves in rawtoaces' format, got none ({error!r})"
        ) from None
    return CameraCurves(np.maximum(np.nan_to_num(curves), 0.0))


def bent_curves(rng: np.random.Generator) -> CameraCurves:
    """Return the curves of this simulated camera."""
    return CameraCurves(np.array([_bent(row, rng) for row in measured_curves().sensitivity]))


def _bent(curve: FloatArray, rng: np.random.Generator) -> FloatArray:
    peak = curve.max()
    goal = rng.uniform(*DISAGREEMENT_RMS)
    factor, added = CubicSpline(KNOTS_NM, rng.standard_normal((2, len(KNOTS_NM))), axis=1)(
        WAVELENGTH_NM.clip(KNOTS_NM[0])
    )
    visible = (WAVELENGTH_NM > 400.0) & (WAVELENGTH_NM < 700.0)

    def normalised(strength: float) -> FloatArray:
        bent = curve / peak * np.exp(strength * factor) + strength * ADDED * added
        # No ultraviolet passes the lens.
        positive: FloatArray = np.where(IS_VISIBLE, np.maximum(bent, 0.0), 0.0)
        return positive / float(positive.max())

    def excess(strength: float) -> float:
        difference = (normalised(strength) - curve / peak)[visible]
        return float(np.sqrt(np.mean(difference**2))) - goal

    largest = next(strength for strength in STRENGTHS if excess(strength) > 0)
    result: FloatArray = peak * normalised(brentq(excess, 0.0, largest, xtol=1e-6))
    return result


def glass(edge_nm: float | None) -> FloatArray:
    """Return the transmittance of a lens that absorbs half at `edge_nm`, shape (wavelengths,)."""
    if edge_nm is None:
        return np.ones_like(WAVELENGTH_NM)
    depth = np.log(2) * np.exp(np.minimum((edge_nm - WAVELENGTH_NM) / GLASS_EDGE_NM, 50.0))
    return np.asarray(np.exp(-depth))


def film(arrangement: str | None) -> FloatArray:
    """Return the part of unpolarised light that a polariser passes, 1 without one."""
    if arrangement is None:
        return np.ones_like(WAVELENGTH_NM)
    return np.asarray(FILM / (1 + np.exp((FILM_EDGE_NM - WAVELENGTH_NM) / FILM_WIDTH_NM)))


def emission(material: Material) -> FloatArray:
    """Return Λ of every state as a smooth spectrum, shape (states, wavelengths).

    A spectrum in the file gives the shape; without one it is the slope of a monotone curve through
    the bands' running sum, so that its mean over each band is the file's number.

    Raises
    ------
    UsageError
        The file has no re-radiation.
    """
    if material.bands_nm is None or any(state.reradiation is None for state in material.states):
        raise UsageError(
            f"{material.name}: expected 'bands_nm' and 'reradiation' in every state, which a "
            "simulated sample needs to glow"
        )
    bands = np.array([state.reradiation for state in material.states], dtype=np.float64)
    if material.spectrum is not None:
        measured = material.spectrum
        shape = PchipInterpolator(measured.wavelength_nm, measured.value, extrapolate=False)
        spectrum = np.nan_to_num(shape(WAVELENGTH_NM))
        cells = band_cells(material.bands_nm)
        in_bands = (cells @ spectrum / np.maximum(cells.sum(axis=1), 1e-12)).sum()
        return np.outer(bands.sum(axis=1) / in_bands, spectrum)
    edges = np.asarray(material.bands_nm)
    below = np.pad(np.cumsum(bands * np.diff(edges), axis=1), ((0, 0), (2, 1)), mode="edge")
    below[:, :2] = 0.0
    # A band beyond either end, in which there is nothing.
    knots = np.concatenate([[2 * edges[0] - edges[1]], edges, [2 * edges[-1] - edges[-2]]])
    running = PchipInterpolator(knots, below, axis=1, extrapolate=False)
    return np.nan_to_num(running(WAVELENGTH_NM, 1))


def vignetting(height: int, width: int, focal_mm: float = FOCAL_MM) -> FloatArray:
    """Return a pixel's light relative to the middle, cos⁴ of the field angle, (height, width)."""
    y = (np.arange(height) - (height - 1) / 2)[:, None]
    x = (np.arange(width) - (width - 1) / 2)[None, :]
    corner = CORNER_MM / focal_mm
    tangent2 = corner**2 * (x**2 + y**2) / ((height / 2) ** 2 + (width / 2) ** 2)
    falloff: FloatArray = (1 + tangent2) ** -2
    return falloff


#: Luminous efficacy of light of 540 THz in lm/W (SI, since 2019), and mcd in a cd.
KM_LM_PER_W = 683.0
MCD = 1000.0


#: V(λ) of CIE 1924 from 380 nm to 780 nm in steps of 10 nm.
STEPS_NM: FloatArray = np.arange(380.0, 781.0, 10.0)
STEPS = (
    3.9e-05, 0.00012, 0.000396, 0.00121, 0.004, 0.0116, 0.023, 0.038,
    0.06, 0.09098, 0.13902, 0.20802, 0.323, 0.503, 0.71, 0.862,
    0.954, 0.99495, 0.995, 0.952, 0.87, 0.757, 0.631, 0.503,
    0.381, 0.265, 0.175, 0.107, 0.061, 0.032, 0.017, 0.00821,
    0.004102, 0.002091, 0.001047, 0.00052, 0.0002492, 0.00012, 6e-05, 3e-05,
    1.499e-05,
)  # fmt: skip
PHOTOPIC: FloatArray = np.nan_to_num(
    PchipInterpolator(STEPS_NM, STEPS, extrapolate=False)(WAVELENGTH_NM)
)


def luminance_mcd_per_m2(radiance: FloatArray, lamp: LampSettings) -> FloatArray:
    """Return the luminance of spectra (…, wavelengths) in the room's scale of radiance, (…).

    In that scale a white surface under the lamp has `REFLECTED` times the irradiance; its
    luminance is the illuminance over π.
    """
    seen = CELL_NM * KM_LM_PER_W * (radiance @ PHOTOPIC)
    white = CELL_NM * KM_LM_PER_W * float(BURNING_SPECTRUM @ PHOTOPIC)
    scale = lamp.illuminance / np.pi / (REFLECTED * lamp.irradiance * white)
    return np.asarray(MCD * scale * seen)
