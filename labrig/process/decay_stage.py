"""A decay as a part of a chain: its fits, figures and files, without a report of its own."""

from dataclasses import replace

from labrig.errors import FitError
from labrig.fit import DecayFit
from labrig.process.decay import fit_warnings, measure_decay
from labrig.process.result_folder import write_patch
from labrig.process.stage import Stage, StageResult
from labrig.process.temperature import glow_temperature_c
from labrig.report.decay_figures import linear_decay, logarithmic_decay
from labrig.report.residual_figure import residual_figure
from labrig.report.sections import Picture, Section, Table
from labrig.report.written_numbers import plus_minus, rounded


def process(stage: Stage) -> StageResult:
    """Reduce and fit every patch.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed after the run.
    FitError
        No patch could be fitted.
    """
    found = measure_decay(stage.run, stage.protocol, stage.choices, stage.known)
    fits = {name: fit for name, fit in found.fits.items() if isinstance(fit, DecayFit)}
    if not fits:
        raise FitError("; ".join(map(str, found.fits.values())))
    run = stage.run.folder.resolve().name
    pictures = []
    for name, fit in fits.items():
        place = stage.folder if len(found.fits) == 1 else stage.folder / name
        write_patch(place, found.series[name], fit, name, run, glow_temperature_c(stage.run))
        series, file = found.series[name], name.replace(" ", "-").lower()
        pictures += [
            Picture(f"linear-{file}", linear_decay(series, fit), f"{name}: signal after lamp off."),
            Picture(
                f"logarithmic-{file}",
                logarithmic_decay(series, fit),
                f"{name}: the same on a logarithmic axis.",
            ),
            Picture(f"residuals-{file}", residual_figure(series, fit), f"{name}: residuals."),
        ]
    table = Table(
        ("Patch", "State", "k_r / s⁻¹", "Amplitude a / (DN/s)", "Reduced χ²"),
        tuple(
            (
                name,
                str(number),
                plus_minus(state.k_r_per_s, state.k_r_sigma_per_s),
                plus_minus(state.amplitude, state.amplitude_sigma),
                rounded(fit.reduced_chi2, 3),
            )
            for name, fit in fits.items()
            for number, state in enumerate(fit.states, start=1)
        ),
        "Value ± standard uncertainty (1 σ).",
    )
    return StageResult(
        known=replace(stage.known, decays=fits),
        sections=(Section("Decay", (), tuple(pictures), (table,)),),
        lines=tuple(f"{name}\n{fit}" for name, fit in fits.items()),
        warnings=(*found.run_warnings, *fit_warnings(found.fits)),
    )
