"""What an excitation fit says: lines, a section of the report, a file of numbers."""

import json
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.excitation.charges import Charged
from labrig.analyse.excitation.figures import (
    charging_picture,
    fitted_values,
    rates_picture,
    residual_picture,
)
from labrig.calibration.irradiance_file import IrradianceFile
from labrig.compare.closure import Closure
from labrig.fit.excitation import ExcitationFit
from labrig.report.sections import Section, Table
from labrig.written_numbers import plus_minus, rounded

FloatArray = NDArray[np.float64]

MEASURED = (
    "r(0) and a = Λ* k_r r(0) after the brightest charge by the lamp itself. Nothing is assumed of "
    "r(0): how the charging curves bend tells it."
)
ASSUMED = "r(0) = 1 is assumed after the longest charge, as Nalbach et al. do."


def closure_line(test: Closure | None) -> str:
    if test is None:
        return "not tested; give three charges or more in 'bare'"
    return (
        f"charging by the lamp itself is predicted within {rounded(test.rms_percent, 2)} % "
        f"({rounded(test.rms_sigma, 2)} σ) rms"
    )


def lines(fit: ExcitationFit, irradiance: IrradianceFile) -> list[str]:
    edges = irradiance.bands_nm
    lines = []
    for number, state in enumerate(fit.states):
        r0, sigma = fit.at_off[-1].r0[number], fit.at_off[-1].r0_sigma[number]
        lines.append(
            f"state {number + 1}: k_r {plus_minus(state.k_r_per_s, state.k_r_sigma_per_s)} /s, "
            f"r(0) {plus_minus(float(r0), float(sigma))}"
        )
        lines += [
            f"  {low:.0f}-{high:.0f} nm: k_e {text} /s"
            for low, high, text in zip(edges, edges[1:], _rates(fit, number), strict=False)
        ]
    lines.append(f"reduced χ² {rounded(fit.reduced_chi2, 3)} ({fit.dof} dof)")
    return lines


def _rates(fit: ExcitationFit, number: int) -> list[str]:
    state = fit.states[number]
    return [
        plus_minus(float(value), float(sigma)) if seen else f"< {rounded(float(upper), 2)}"
        for value, sigma, seen, upper in zip(
            state.k_e_per_s, state.k_e_sigma_per_s, state.seen, state.k_e_upper_per_s, strict=True
        )
    ]


def section(
    fit: ExcitationFit, measured: Charged, irradiance: IrradianceFile, test: Closure | None
) -> Section:
    edges = np.array(irradiance.bands_nm)
    position_nm = _wavelengths(irradiance)
    states = range(len(fit.states))
    columns = [_rates(fit, number) for number in states]
    head = ("Band / nm", *(f"k_e of state {number + 1} / s⁻¹" for number in states))
    rows = tuple(
        (f"{low:.0f}–{high:.0f}", *(column[band] for column in columns))
        for band, (low, high) in enumerate(pairwise(edges))
    )
    levels = Table(
        ("State", "k_r / s⁻¹", "Amplitude at r = 1 / (DN/s)", "r(0)", "Amplitude a / (DN/s)"),
        tuple(
            (
                str(number + 1),
                plus_minus(state.k_r_per_s, state.k_r_sigma_per_s),
                plus_minus(state.amplitude, state.amplitude_sigma),
                plus_minus(float(off.r0[number]), float(off.r0_sigma[number])),
                plus_minus(float(off.amplitude[number]), float(off.amplitude_sigma[number])),
            )
            for off in fit.at_off[-1:]
            for number, state in enumerate(fit.states)
        ),
        ASSUMED if _assumed(measured) else MEASURED,
    )
    figures = [
        rates_picture(fit, irradiance.bands_nm),
        charging_picture(
            measured.through, fitted_values(measured.through, fit.residuals[0]), position_nm
        ),
        residual_picture(fit.residuals[0], position_nm),
    ]
    if test is not None:
        figures.append(test.picture)
    return Section(
        "Excitation",
        (
            f"{len(measured.through.charges)} charges through the variable filter and "
            f"{len(measured.bare.charges)} by the lamp itself, fitted together by the rate "
            "equation in exact steps. k_e belongs to an irradiance of vector length "
            f"{rounded(irradiance.vector_length)}.",
            f"Closure: {closure_line(test)}.",
        ),
        tuple(figures),
        (levels, Table(head, rows, "Value ± 1 σ, or what it is below with 95 % probability.")),
    )


def _assumed(measured: Charged) -> bool:
    return any(charge.saturated for charge in measured.bare.charges)


def _wavelengths(irradiance: IrradianceFile) -> FloatArray:
    """(P,) mean wavelength of the light at every place."""
    edges, through = np.array(irradiance.bands_nm), np.array(irradiance.through)
    middles = (edges[1:] + edges[:-1]) / 2
    # Squared, so that what leaks all over does not pull.
    found: FloatArray = through**2 @ middles / np.maximum((through**2).sum(axis=1), 1e-300)
    return found


def fit_json(fit: ExcitationFit, irradiance: IrradianceFile) -> str:
    off = fit.at_off[-1]
    content = {
        "bands_nm": irradiance.bands_nm,
        "irradiance_vector_length": irradiance.vector_length,
        "states": [
            {
                "k_r_per_s": state.k_r_per_s,
                "k_r_sigma_per_s": state.k_r_sigma_per_s,
                "amplitude_at_full_charge": state.amplitude,
                "amplitude_at_full_charge_sigma": state.amplitude_sigma,
                "k_e_per_s": state.k_e_per_s.tolist(),
                "k_e_sigma_per_s": state.k_e_sigma_per_s.tolist(),
                "k_e_upper_per_s": state.k_e_upper_per_s.tolist(),
                "r0": float(off.r0[number]),
                "r0_sigma": float(off.r0_sigma[number]),
            }
            for number, state in enumerate(fit.states)
        ],
        "channel_weights": fit.channel_weights.tolist(),
        "reduced_chi2": fit.reduced_chi2,
        "dof": fit.dof,
        "covariance": fit.covariance.tolist(),
        "warnings": list(fit.warnings),
    }
    return json.dumps(content, ensure_ascii=False, indent=1) + "\n"
