"""Result of an excitation run: excitation rates by band, and the material from them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from labrig.calibration import IrradianceFile
from labrig.foundation.arrays import FloatArray
from labrig.foundation.output_file import make_folder_in
from labrig.material import Material, write_material
from labrig.results.budget import Budget, named
from labrig.results.charging_series import ChargingSeries
from labrig.results.fitted_decay import FittedDecay
from labrig.results.fitted_excitation import (
    THICKNESS,
    BandTests,
    Closure,
    FittedExcitation,
    LayerEffect,
)
from labrig.results.measured import Measured, measured_number
from labrig.results.run_result import RunResult
from labrig.results.series import Series
from labrig.results.text_files import finite, write_json


@dataclass(frozen=True, eq=False)
class PatchCharging:
    """Charging of a patch at P places along the filter, or as a whole by one light after another.

    Attributes
    ----------
    through, direct
        Charges through the filter, or by selected lights, and by the lamp itself, at the same
        places. Their values are divided by `evenness`.
    evenness
        Relative signal of each place in even light, by lens and sample, 1 on average, shape (P,).
    whole
        Series of the whole strip after the last charge by the lamp itself.
    """

    through: ChargingSeries
    direct: ChargingSeries
    evenness: FloatArray
    whole: Series


@dataclass(frozen=True)
class LightScatter:
    """Errors of the light that no calibration states, as the glow shows them.

    Attributes
    ----------
    lamp
        Relative scatter of the lamp's brightness from charge to charge.
    wavelength_nm
        Error of the filter's wavelengths in nm, smooth along it; None of selected lights.
    sites
        Relative scatter of the light on single places; None of selected lights.
    """

    lamp: float
    wavelength_nm: float | None
    sites: float | None


@dataclass(frozen=True, eq=False)
class PatchExcitation:
    """Excitation of a patch.

    Attributes
    ----------
    charging
        Light, charges, and photographs after each.
    decay
        Decay of the whole strip after the last charge; where the fit of the charges started.
    fit
        Fit of all charges together; its residuals are those of `charging.through`, then of
        `charging.direct`.
    light
        Scatter of the light, which is in all σ of `fit`.
    material
        Material by these rates, with re-radiance where the emission spectrum is known.
    closure
        Charging by the lamp itself, as predicted from charges through the filter; None if there
        were too few charges to test it.
    """

    charging: PatchCharging
    decay: FittedDecay
    fit: FittedExcitation
    light: LightScatter
    material: Material
    closure: Closure | None


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcitationResult(RunResult):
    """Excitation rates by band.

    Attributes
    ----------
    irradiance
        Irradiance calibration that the analysis used.
    patches
        Excitation of each patch by its name; that of the only one under "".

    Examples
    --------
    >>> result = labrig.read_result(run)  # doctest: +SKIP
    >>> for patch in result.patches.values():
    ...     for state in patch.fit.states:
    ...         print(result.irradiance.bands_nm, state.k_e_per_s, state.k_e_per_s_sigma)
    """

    kind: ClassVar[str] = "excitation"

    irradiance: IrradianceFile
    patches: Mapping[str, PatchExcitation]

    @property
    def position_nm(self) -> FloatArray:
        """Mean wavelength at every place behind the filter, or of every light, in nm, (P,)."""
        edges, transmitted = np.array(self.irradiance.bands_nm), np.array(self.irradiance.through)
        middles = (edges[1:] + edges[:-1]) / 2
        # Squared, so that what leaks all over does not pull.
        position_nm: FloatArray = (
            transmitted**2 @ middles / np.maximum((transmitted**2).sum(axis=1), 1e-300)
        )
        return position_nm

    def provides(self) -> Mapping[str, Any]:
        """Return the materials and the fits by patch."""
        return {
            "materials": {name: patch.material for name, patch in self.patches.items()},
            "excitations": {name: patch.fit for name, patch in self.patches.items()},
        }

    def budgets(self) -> dict[str, Budget]:
        """Return the budgets of k_r, of k_e in the bands that are seen to excite, and of Λ."""
        return {
            named(name, quantity): budget
            for name, patch in self.patches.items()
            for quantity, budget in self._patch_budgets(patch)
        }

    def _patch_budgets(self, patch: PatchExcitation) -> Iterator[tuple[str, Budget]]:
        fit, layer = patch.fit, patch.fit.layer
        edges = self.irradiance.bands_nm
        direct = np.maximum(np.array(self.irradiance.direct), 1e-300)
        light = np.array(self.irradiance.direct_sigma) / direct
        by = THICKNESS if layer is not None else ""
        beside = ("kinetic order", THICKNESS if layer is None else "scattering in the sample")
        for number, state in enumerate(fit.states):
            if not state.is_apart:
                continue
            of = f"of state {number + 1}"
            k_r = Measured(state.k_r_per_s, state.k_r_per_s_sigma, "1/s")
            yield f"k_r {of}", Budget.of(k_r)
            for band in np.flatnonzero(state.seen):
                k_e = Measured(state.k_e_per_s[band], state.k_e_per_s_sigma[band], "1/s")
                least, largest = fit.k_e_range(number)[:, band].tolist()
                yield (
                    f"k_e {of}, {edges[band]:.0f}-{edges[band + 1]:.0f} nm",
                    Budget.of(
                        Measured(float(k_e.value), float(k_e.sigma), "1/s"),
                        float(light[band] * k_e.value),
                        model_range=None if layer is None else (least, largest),
                        model_of=by,
                        left_out=beside,
                    ),
                )
            material = patch.material.states[number]
            if material.reradiation is None or material.reradiation_sigma is None:
                continue
            peak = int(np.argmax(material.reradiation))
            ends = material.reradiation_range
            factors = patch.material.scale_factors
            scale = np.linalg.norm([(factor.sigma or 0.0) / factor.value for factor in factors])
            value = material.reradiation[peak]
            yield (
                f"Λ {of}, {edges[peak]:.0f}-{edges[peak + 1]:.0f} nm",
                Budget.of(
                    Measured(value, material.reradiation_sigma[peak], ""),
                    float(scale * value) if factors else None,
                    model_range=None if ends is None else (ends[0][peak], ends[1][peak]),
                    model_of=by,
                    left_out=beside,
                ),
            )

    def write_files(self, folder: Path) -> None:
        """Write `material.yaml` and `excitation.json` of each patch, in a folder of its name."""
        for name, patch in self.patches.items():
            place = make_folder_in(folder, name)
            write_material(place / "material.yaml", patch.material)
            write_json(place / "excitation.json", finite(self._fit_content(patch)))

    def _fit_content(self, patch: PatchExcitation) -> dict[str, Any]:
        fit, light, veil = patch.fit, patch.light, patch.fit.veil
        level_at_off = fit.at_off[-1]
        return {
            "schema_version": self.schema_version,
            "bands_nm": self.irradiance.bands_nm,
            "irradiance_vector_length": self.irradiance.vector_length,
            "thickness": None if fit.layer is None else _layer(fit.layer),
            "states": [
                {
                    "k_r_per_s": state.k_r_per_s,
                    "k_r_per_s_sigma": state.k_r_per_s_sigma,
                    "kinetic_order": state.kinetic_order,
                    "kinetic_order_sigma": state.kinetic_order_sigma,
                    "kinetic_order_limit_95": measured_number(state.order).get("limit_95"),
                    "amplitude_at_full_charge": state.amplitude,
                    "amplitude_at_full_charge_sigma": state.amplitude_sigma,
                    "k_e_per_s": state.k_e_per_s.tolist(),
                    "k_e_range_per_s": fit.k_e_range(number).tolist(),
                    "k_e_per_s_sigma": state.k_e_per_s_sigma.tolist(),
                    "k_e_upper_per_s": state.k_e_upper_per_s.tolist(),
                    "r0": float(level_at_off.r0[number]),
                    "r0_sigma": float(level_at_off.r0_sigma[number]),
                    "is_level_known": state.is_level_known,
                    "amplitude": float(level_at_off.amplitude[number]),
                    "amplitude_sigma": float(level_at_off.amplitude_sigma[number]),
                    "decay_time_s": float(level_at_off.decay_time_s[number]),
                    "decay_time_s_sigma": float(level_at_off.decay_time_s_sigma[number]),
                }
                for number, state in enumerate(fit.states)
            ],
            "light": {
                "lamp_scatter": light.lamp,
                "wavelength_error_nm": light.wavelength_nm,
                "site_scatter": light.sites,
            },
            "veil": None if veil is None else veil.value,
            "veil_sigma": None if veil is None else veil.sigma,
            "veil_limit_95": None if veil is None else measured_number(veil).get("limit_95"),
            "by_band": None if fit.by_band is None else _by_band(fit.by_band),
            "channel_weights": fit.channel_weights.tolist(),
            "reduced_chi2": fit.reduced_chi2,
            "dof": fit.dof,
            "covariance_parameters": list(fit.covariance_parameters),
            "covariance": fit.covariance.tolist(),
            "intervals": {name: each.to_dict() for name, each in fit.intervals.items()},
            "models": [vars(model) for model in fit.models],
            "warnings": [each.to_dict() for each in fit.warnings],
        }


def _layer(layer: LayerEffect) -> dict[str, Any]:
    """Return the effect of thickness as content of a file."""
    return {
        "optical_density": list(layer.optical_density),
        "basis": str(layer.basis),
        "k_e_factor": layer.k_e_factor.tolist(),
        "reradiation_factor": layer.reradiation_factor.tolist(),
    }


def _by_band(tests: BandTests) -> dict[str, Any]:
    """Return the tests of one glow for all bands as content of a file."""
    quantities = {"amplitude": tests.amplitude, "rate": tests.rate, "hue": tests.hue}
    return {
        "bands": tests.bands.tolist(),
        "light_variance": tests.light_variance.value,
        "light_variance_sigma": tests.light_variance.sigma,
        "charged_glow_by_variance": tests.charged_glow_by_variance,
        "is_thick": tests.is_thick,
        **{
            name: {
                "deviation": quantity.deviation.tolist(),
                "sigma": quantity.sigma.tolist(),
                "p_value": quantity.p_value,
                "differs": quantity.differs,
            }
            for name, quantity in quantities.items()
            if quantity is not None
        },
    }
