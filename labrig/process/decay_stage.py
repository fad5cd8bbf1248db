"""A decay as a part of a chain: its fits, figures and files, without a report of its own."""

from dataclasses import replace

from labrig.analyse.part import Part, StageResult
from labrig.analyse.temperature import glow_temperature_c
from labrig.errors import FitError
from labrig.fit import DecayFit
from labrig.process.decay import fit_warnings, measure_decay
from labrig.process.result_folder import write_patch
from labrig.report.decay_figures import linear_decay, logarithmic_decay
from labrig.report.residual_figure import residual_figure
from labrig.report.sections import Picture, Section, Table
from labrig.written_numbers import plus_minus, rounded


def process(part: Part) -> StageResult:
    """Reduce and fit every patch.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed after the run.
    FitError
        No patch could be fitted.
    """
    found = measure_decay(part.run, part.protocol, part.choices, part.inputs)
    fits = {name: fit for name, fit in found.fits.items() if isinstance(fit, DecayFit)}
    if not fits:
        raise FitError("; ".join(map(str, found.fits.values())))
    run = part.run.folder.resolve().name
    pictures = []
    for name, fit in fits.items():
        place = part.folder if len(found.fits) == 1 else part.folder / name
        write_patch(place, found.series[name], fit, name, run, glow_temperature_c(part.run))
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
        known=replace(part.inputs, decays=fits),
        sections=(Section("Decay", (), tuple(pictures), (table,)),),
        lines=tuple(f"{name}\n{fit}" for name, fit in fits.items()),
        warnings=(*found.run_warnings, *fit_warnings(found.fits)),
    )
