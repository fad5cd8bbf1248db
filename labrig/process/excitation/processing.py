"""A run of `excitation`, from its frames to rates and a material."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from labrig.calibration.irradiance_file import IrradianceFile
from labrig.compare.closure import Closure, closure
from labrig.errors import DataError
from labrig.fit import DecayFit
from labrig.fit.excitation import ExcitationFit, Uncertain, fit_excitation
from labrig.material import write_material
from labrig.process.excitation.charges import GLOWING, Charged, charged
from labrig.process.excitation.figures import (
    charging_picture,
    fitted_values,
    rates_picture,
    residual_picture,
)
from labrig.process.excitation.lamp_changes import lamp_changes
from labrig.process.excitation.material import excited_material
from labrig.process.intact import insist_on_intact
from labrig.process.series_fit import TYPICAL_FLICKER, fit_series
from labrig.process.stage import Stage, StageResult
from labrig.report.sections import Section, Table
from labrig.report.written_numbers import plus_minus, rounded

FloatArray = NDArray[np.float64]

#: Of a lamp's brightness from charge to charge, and what one lacks that was just switched on.
LAMP, COLD = 0.01, 0.03
#: No dark level is known better, in DN/s.
LEAST_DARK = 1e-3
#: Names of a result's files.
FIT_FILE, MATERIAL_FILE = "excitation.json", "material.yaml"
MEASURED = (
    "r(0) and a = Λ* k_r r(0) after the brightest charge by the lamp itself. Nothing is assumed of "
    "r(0): how the charging curves bend tells it."
)
ASSUMED = "r(0) = 1 is assumed after the longest charge, as Nalbach et al. do."


def process(stage: Stage) -> StageResult:
    """Reduce all charges, fit them together, write the material.

    Raises
    ------
    DataError
        Nothing is known of the light on the sample, or charges are missing.
    FitError
        Nothing glows, or what glows cannot be fitted.
    """
    irradiance, protocol, known = stage.known.irradiance, stage.protocol, stage.known
    if irradiance is None:
        raise DataError(
            "expected the light on every place of the sample, got none; run irradiance and name "
            "its run in the rig file: 'optics: {irradiance: …}'"
        )
    insist_on_intact(stage.run, (*GLOWING, "dark"), stage.choices)
    bands_nm = np.array(irradiance.bands_nm)
    rise, fade = lamp_changes(known.fade, bands_nm)
    measured = charged(
        stage.run, irradiance, rise, fade, stage.choices,
        fresh=protocol.samples > 1, saturated=protocol.saturated,
    )  # fmt: skip
    asked = stage.choices.states or (None if protocol.states == "auto" else protocol.states)
    start = _start(stage, measured, asked)
    uncertain = Uncertain(
        flicker=_flicker(stage, start),
        lamp=LAMP,
        cold=COLD,
        offset=tuple(np.maximum(np.nan_to_num(measured.whole.dark_sigma), LEAST_DARK).tolist()),
        scale=irradiance.scale_sigma,
        irradiance=_irradiance_sigma(irradiance),
    )
    fit = _fit(measured, start, uncertain)
    test = _closure(measured, start, uncertain, irradiance)
    name = protocol.sample.name
    frames = tuple(frame.path.name for purpose in GLOWING for frame in stage.run.frames(purpose))
    material = excited_material(
        fit, irradiance, known.spectrum, name, stage.run.folder.resolve().name, frames
    )
    write_material(stage.folder / MATERIAL_FILE, material)
    (stage.folder / FIT_FILE).write_text(_json(fit, irradiance), encoding="utf-8", newline="\n")
    unmeasured = [] if known.fade else ["the lamp's fade was not measured: a usual one was taken"]
    return StageResult(
        known=replace(known, material=material),
        sections=(_section(fit, measured, irradiance, test),),
        lines=(*_lines(fit, irradiance), f"closure: {_told(test)}"),
        warnings=(*unmeasured, *start.warnings, *fit.warnings),
    )


def _start(stage: Stage, measured: Charged, states: int | None) -> DecayFit:
    """The decay after the last bare charge; as many states as a decay of this sample had."""
    known = stage.known.decays or {}
    if states is None and len(known) == 1:
        states = len(next(iter(known.values())).states)
    return fit_series(measured.whole, states)


def _fit(measured: Charged, start: DecayFit, uncertain: Uncertain) -> ExcitationFit:
    rates = [state.k_r_per_s for state in start.states]
    amplitudes = np.array([state.amplitude for state in start.states])
    shares = np.maximum(amplitudes / amplitudes.sum(), 1e-3)
    return fit_excitation([measured.through, measured.bare], rates, shares, uncertain)


def _flicker(stage: Stage, start: DecayFit) -> float:
    if stage.known.camera is not None:
        return stage.known.camera.flicker
    return start.flicker if start.flicker > 0 else TYPICAL_FLICKER


def _irradiance_sigma(irradiance: IrradianceFile) -> tuple[float, ...]:
    """Relative, of each band: that of the places where the band charges.

    Errors of neighbouring places are alike, so that a band's do not average out over its places.
    """
    through, sigma = np.array(irradiance.through), np.array(irradiance.through_sigma)
    told = np.sqrt((sigma**2).sum(axis=1)) / np.maximum(through.sum(axis=1), 1e-300)
    share = through**2 / np.maximum((through**2).sum(axis=0), 1e-300)
    direct = np.array(irradiance.direct_sigma) / np.maximum(np.array(irradiance.direct), 1e-300)
    return tuple(np.hypot(told @ share, direct).tolist())


def _closure(
    measured: Charged, start: DecayFit, uncertain: Uncertain, irradiance: IrradianceFile
) -> Closure | None:
    """Charging by the lamp itself as predicted from charges through the filter.

    The longest bare charge stays in the fit, since it tells how far the sample is charged; the
    shorter ones are predicted. With fewer than two of those there is no test.
    """
    bare = measured.bare
    lengths = [charge.off_s - charge.on_s for charge in bare.charges]
    longest = int(np.argmax(lengths))
    ends = np.cumsum([0, *(len(charge.start_s) for charge in bare.charges)])
    kept = np.zeros(ends[-1], dtype=bool)
    kept[ends[longest] : ends[longest + 1]] = True
    if len(lengths) < 3:
        return None
    alone = replace(
        measured,
        bare=replace(bare, values=np.where(kept[:, None, None], bare.values, np.nan)),
    )
    fit = _fit(alone, start, uncertain)
    channel = int(np.argmax(fit.channel_weights))
    rows, charges = [], []
    for number, charge in enumerate(bare.charges):
        for row in range(ends[number], ends[number + 1]):
            if np.isfinite(bare.values[row, :, channel]).all():
                rows.append(row)
                charges.append((lengths[number], charge, row - ends[number]))
                break
    values, sigma = bare.values[rows, :, channel], bare.sigma[rows, :, channel]
    level = values.mean(axis=1)
    noise = np.hypot(np.sqrt((sigma**2).sum(axis=1)) / sigma.shape[1], uncertain.flicker * level)
    return closure(
        [length for length, _, _ in charges],
        level,
        np.hypot(noise, uncertain.lamp * level),
        irradiance=irradiance.direct,
        k_e_per_s=fit.k_e(),
        k_r_per_s=[state.k_r_per_s for state in fit.states],
        full_level=[state.amplitude for state in fit.states],
        dark_s=[charge.start_s[place] - charge.off_s for _, charge, place in charges],
        exposure_s=[charge.exposure_s[place] for _, charge, place in charges],
    )


def _told(test: Closure | None) -> str:
    if test is None:
        return "not tested; give three charges or more in 'bare'"
    return (
        f"charging by the lamp itself is predicted within {rounded(test.rms_percent, 2)} % "
        f"({rounded(test.rms_sigma, 2)} σ) rms"
    )


def _lines(fit: ExcitationFit, irradiance: IrradianceFile) -> list[str]:
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


def _section(
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
            f"Closure: {_told(test)}.",
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
    found: FloatArray = through @ middles / np.maximum(through.sum(axis=1), 1e-300)
    return found


def _json(fit: ExcitationFit, irradiance: IrradianceFile) -> str:
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
