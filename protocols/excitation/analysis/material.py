"""Material from a fitted excitation and the emission spectrum."""

from importlib.metadata import version
from itertools import pairwise
from typing import Any

import numpy as np

from labrig.calibration import IrradianceFile, PatchReflectance
from labrig.foundation.arrays import FloatArray
from labrig.material import IrradianceNorm, Material, Provenance, State
from labrig.results import (
    PRIOR_DENSITY,
    DensityBasis,
    EmissionSpectrum,
    ExcitedState,
    FittedExcitation,
    order_fields,
)

SOURCE = (
    "decay and excitation measured with labrig; amplitudes are those of the brightest channel, in "
    "DN/s unless 'scale' says otherwise, Λ = Λ* amplitude(r = 1) / k_r by the spectrum's peak, "
    "r(0) after the longest charge by the lamp itself"
)


def excited_material(
    fit: FittedExcitation,
    irradiance: IrradianceFile,
    spectrum: EmissionSpectrum | None,
    name: str,
    run: str,
    frames: tuple[str, ...],
) -> Material:
    """Return the material of a fitted excitation, with Λ if there is a spectrum."""
    at_off = fit.at_off[-1]
    bands = np.array(irradiance.bands_nm)
    return Material(
        name=name,
        kind="phosphor",
        bands_nm=irradiance.bands_nm,
        irradiance_norm=IrradianceNorm(kind="vector_length", value=irradiance.vector_length),
        states=tuple(
            State(
                k_r_per_s=state.k_r_per_s,
                k_r_per_s_sigma=_known(state.k_r_per_s_sigma),
                **order_fields(state.order),
                amplitude=float(max(at_off.amplitude[number], 0.0)),
                amplitude_sigma=_known(at_off.amplitude_sigma[number]),
                amplitude_unit="DN/s",
                r0=float(np.clip(at_off.r0[number], 0.0, 1.0)),
                r0_sigma=_known(at_off.r0_sigma[number]),
                **_decay_time(fit, number),
                k_e_per_s=tuple(state.k_e_per_s.tolist()),
                **_range(fit, number, state),
                k_e_per_s_sigma=_all_known(state.k_e_per_s_sigma),
                **_reradiation(fit, number, state, spectrum, bands),
            )
            for number, state in enumerate(fit.states)
        ),
        spectrum=None if spectrum is None else spectrum.for_material(),
        provenance=Provenance(source=SOURCE, run=run, frames=frames, version=version("labrig")),
    )


def _decay_time(fit: FittedExcitation, number: int) -> dict[str, float | None]:
    """Return τ after that charge and its σ; nothing of the first order, an exponential."""
    if fit.states[number].is_first_order:
        return {}
    at_off = fit.at_off[-1]
    return {
        "decay_time_s": float(at_off.decay_time_s[number]),
        "decay_time_s_sigma": _known(at_off.decay_time_s_sigma[number]),
    }


def _range(
    fit: FittedExcitation, number: int, state: ExcitedState
) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Return the range of k_e by thickness; nothing where that was not looked at."""
    if fit.layer is None:
        return {}
    return {"k_e_per_s_range": tuple(map(tuple, fit.k_e_range(number).tolist()))}


def _reradiation(
    fit: FittedExcitation,
    number: int,
    state: ExcitedState,
    spectrum: EmissionSpectrum | None,
    bands_nm: FloatArray,
) -> dict[str, Any]:
    """Return Λ, its range by thickness and σ: A_i / k_r,i times the spectrum's mean by band.

    σ has all their errors. Of an order other than 1 Λ is only known where the charge is.
    """
    if spectrum is None or not state.is_apart:
        return {}
    states = len(fit.states)
    level = state.amplitude / state.k_r_per_s
    indices = [number, states + number]
    slope = np.array([-1 / state.k_r_per_s, 1 / max(state.amplitude, 1e-300)])
    relative = float(slope @ fit.covariance[np.ix_(indices, indices)] @ slope)
    shape, covariance = spectrum.in_bands(bands_nm)
    shape_sigma = np.sqrt(np.diag(covariance))
    value = level * shape
    sigma = level * np.hypot(shape_sigma, shape * np.sqrt(relative))
    value = np.maximum(value, 0.0)
    layer = fit.layer
    ends = () if layer is None else np.outer(layer.reradiation_factor[:, number], value).tolist()
    return {
        "reradiation": tuple(value.tolist()),
        "reradiation_range": tuple(map(tuple, ends)) or None,
        "reradiation_sigma": _all_known(sigma),
    }


def _known(sigma: float) -> float | None:
    """Return a σ; None where the data leave its quantity open, which a file cannot say by inf."""
    return float(sigma) if np.isfinite(sigma) else None


def _all_known(sigma: FloatArray) -> tuple[float, ...] | None:
    """Return the σ of all bands; None if some are not known."""
    return tuple(sigma.tolist()) if np.isfinite(sigma).all() else None


#: σ of an albedo by which less light may have come back.
SIGMAS = 2.0


def largest_density(
    bands_nm: tuple[float, ...], stated: float | None, reflectance: PatchReflectance | None
) -> tuple[FloatArray, DensityBasis]:
    """Return the largest optical density in each band, shape (B,), and where it is from.

    A layer that absorbs the fraction 1 − 10^(−D) of the light sends back at most 10^(−D) of it. An
    albedo R so bounds D to −lg R in every band where it was measured, if the layer does not
    scatter: light that scatters deep in an opaque one may come back, and depth be dark all the
    same.

    Parameters
    ----------
    bands_nm
        Edges of the bands in nm.
    stated
        Largest optical density in any band, as the protocol states it; it goes before a
        reflectance, from which that of a scattering sample does not follow.
    reflectance
        Reflectance of the sample.
    """
    bands = len(bands_nm) - 1
    if stated is not None:
        return np.full(bands, stated), DensityBasis.STATED
    of_bands = np.full(bands, PRIOR_DENSITY)
    if reflectance is None:
        return of_bands, DensityBasis.PRIOR
    nm, albedo = np.array(reflectance.wavelength_nm), np.array(reflectance.albedo)
    least = albedo - SIGMAS * np.array(reflectance.albedo_sigma)
    for band, (low, high) in enumerate(pairwise(bands_nm)):
        inside = least[(nm >= low) & (nm <= high)]
        if not len(inside) and nm[0] <= (low + high) / 2 <= nm[-1]:
            inside = np.array([np.interp((low + high) / 2, nm, least)])
        if len(inside):
            back = float(np.clip(inside.min(), 10.0**-PRIOR_DENSITY, 1.0))
            of_bands[band] = -np.log10(back)
    is_bound = of_bands.max() < PRIOR_DENSITY
    return of_bands, DensityBasis.REFLECTANCE if is_bound else DensityBasis.PRIOR
