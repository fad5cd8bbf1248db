"""`labrig plan --predict`: expected uncertainties, and changes that would halve them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.completion import complete_material
from labrig.cli.screen import echo, echo_table
from labrig.foundation.result_warning import ResultWarning, Undetermined, warning_lines

if TYPE_CHECKING:
    from labrig.bench import Recording
    from labrig.predict import PatchPrediction, Prediction, Remedy

    #: Heads of the columns of a table, and its rows.
    _Rows = tuple[list[str], list[list[str]]]

PredictOption = Annotated[
    list[str] | None,
    typer.Option(
        "--predict",
        metavar="[PATCH=]MATERIAL",
        help="Expected σ of its rates, instead of the timeline: a shipped material, a file, or "
        "RUN/result/material.yaml, which knows camera and brightness. Repeatable.",
        autocompletion=complete_material,
    ),
]
LikeOption = Annotated[
    Path | None,
    typer.Option("--like", help="With --predict: an earlier run, for camera and flicker."),
]
MeteredOption = Annotated[
    str | None,
    typer.Option(
        "--metered",
        help="With --predict, if no run has the brightness of the material: the exposure that "
        "metering chooses for the first frame, such as '0.5 s'.",
    ),
]

#: Fraction of the variance from which a source of noise is listed.
WORTH_SAYING = 0.1
#: Relative σ of a rate or an amplitude from which a warning is given.
HARDLY_KNOWN = 0.5
#: Fraction of the lab time below which a difference counts as none.
SAME_TIME = 0.005


def predict_and_print(
    recording: "Recording",
    materials: list[str],
    like: Path | None,
    metered: str | None,
    *,
    json: bool,
) -> None:
    """Predict the uncertainties of a protocol on its rig and print them."""
    from labrig.bench_optics import calibration, camera_curves
    from labrig.calibration import LVF_KIND
    from labrig.predict import Sources, predict

    optics = recording.rig.optics
    lvf = calibration(recording.rig, LVF_KIND)
    response = None if optics.camera is None else camera_curves(recording.rig, lvf=lvf)
    sources = Sources.parse(materials, like, metered, response)
    prediction = predict(
        recording.protocol, recording.plan, recording.rig, str(recording.rig_source), sources
    )
    if json:
        typer.echo(prediction.to_json())
    else:
        _print_prediction(prediction, recording.plan.duration_s)


def _print_prediction(prediction: "Prediction", duration_s: float) -> None:
    for patch in prediction.patches:
        echo(_title(prediction, patch), bold=True)
        echo_table(*_states(prediction.patches[patch]))
        for line in warning_lines(_warnings(prediction, patch)):
            echo(line, fg="yellow")
        if any(remedy.helps for remedy in prediction.remedies):
            echo("\nwhat would halve it", bold=True)
            echo_table(*_remedies(prediction, patch, duration_s))
        echo()
    useless = [remedy.change.description for remedy in prediction.remedies if not remedy.helps]
    if useless:
        echo(f"no help: {', '.join(useless)}")
    for line in warning_lines(prediction.warnings):
        echo(line, fg="yellow")
    for line in prediction.notes:
        echo(line, dim=True)


def _states(predicted: "PatchPrediction") -> "_Rows":
    """Return head and rows of the states of a patch."""
    from labrig.results import with_uncertainty

    has_order = any(order != 1 for order in predicted.kinetic_order)
    rate_heading = "rate at lamp off / s⁻¹" if has_order else "k_r / s⁻¹"
    order_heading = ["order b"] if has_order else []
    head = ["state", rate_heading, "σ", *order_heading, "σ of amplitude", "noise"]
    orders = list(zip(predicted.kinetic_order, predicted.kinetic_order_sigma, strict=True))
    rows = [
        [
            str(i + 1),
            with_uncertainty(rate, predicted.rate_per_s_sigma[i]),
            _percent(predicted.rate_per_s_sigma[i] / rate),
            *([with_uncertainty(*orders[i])] if has_order else []),
            _percent(predicted.amplitude_dn_per_s_sigma[i] / predicted.amplitude_dn_per_s[i]),
            _noise(predicted, i),
        ]
        for i, rate in enumerate(predicted.rate_per_s)
    ]
    return head, rows


def _title(prediction: "Prediction", patch: str) -> str:
    shortest, longest = (f"{f(prediction.exposures_s):.3g} s" for f in (min, max))
    exposures = shortest if shortest == longest else f"{shortest} to {longest}"
    frames = f"{len(prediction.exposures_s)} frames of {exposures}"
    decays = "" if prediction.decays == 1 else f", {prediction.decays} decays"
    clipped = prediction.patches[patch].clipped
    lost = f", {clipped} of them clipped" if clipped else ""
    return f"{prediction.materials[patch]} on '{patch}': {frames}{decays}{lost}"


def _noise(predicted: "PatchPrediction", state: int) -> str:
    fractions = {source: part[state] for source, part in predicted.budget.items()}
    largest = sorted(fractions, key=lambda source: -fractions[source])
    return ", ".join(
        f"{source} {100 * fractions[source]:.0f} %"
        for source in largest
        if fractions[source] >= WORTH_SAYING
    )


def _warnings(prediction: "Prediction", patch: str) -> list[ResultWarning]:
    """Return warnings about states that the fit will not resolve, with a change that would help."""
    predicted = prediction.patches[patch]
    warnings: list[ResultWarning] = []
    if not predicted.resolves_all_states:
        sufficient = [
            remedy for remedy in prediction.remedies if remedy.patches[patch].resolves_all_states
        ]
        cheapest = min(sufficient, key=lambda remedy: remedy.extra_time_s, default=None)
        would = f"'{cheapest.change.description}' would" if cheapest else "nothing below is enough"
        warnings.append(
            Undetermined(
                "states-unresolved",
                "the fit may not resolve these {states} states: it detects all of them with a "
                "chance of {chance_percent:.0f} %, and their rates {sigmas_apart:.1f} σ from each "
                "other; {remedy}",
                states=len(predicted.rate_per_s),
                chance_percent=100 * predicted.chance_of_all_states,
                sigmas_apart=predicted.least_apart,
                remedy=would,
            )
        )
    for i, rate in enumerate(predicted.rate_per_s):
        rate_sigma = predicted.rate_per_s_sigma[i] / rate
        amplitude_sigma = predicted.amplitude_dn_per_s_sigma[i] / predicted.amplitude_dn_per_s[i]
        if max(rate_sigma, amplitude_sigma) > HARDLY_KNOWN:
            warnings.append(
                Undetermined(
                    "rate-unresolved",
                    "state {state} is hardly determined: its rate to {rate_sigma}, its amplitude "
                    "to {amplitude_sigma}",
                    state=i + 1,
                    rate_sigma=_percent(rate_sigma),
                    amplitude_sigma=_percent(amplitude_sigma),
                )
            )
    return warnings


def _remedies(prediction: "Prediction", patch: str, duration_s: float) -> "_Rows":
    """Return head and rows of the changes that help; one that halves σ is marked."""
    predicted = prediction.patches[patch]
    count = len(predicted.rate_per_s)
    resolves = [] if predicted.resolves_all_states else ["finds all"]
    sigmas = ["σ"] if count == 1 else [f"σ {i + 1}" for i in range(count)]
    head = ["change (* halves σ)", *sigmas, "σ ×", *resolves, "lab time"]
    rows = []
    for remedy in prediction.remedies:
        if not remedy.helps:
            continue
        after = remedy.patches[patch]
        rows.append([
            f"{remedy.change.description}{' *' if remedy.halves else ''}",
            *(
                _percent(sigma / rate)
                for sigma, rate in zip(after.rate_per_s_sigma, after.rate_per_s, strict=True)
            ),
            f"{remedy.gain:.2f}",
            *(["yes" if after.resolves_all_states else "no"] if resolves else []),
            _extra_time(remedy, duration_s),
        ])  # fmt: skip
    return head, rows


def _extra_time(remedy: "Remedy", duration_s: float) -> str:
    from labrig.foundation.quantity import duration_text

    if abs(remedy.extra_time_s) < SAME_TIME * duration_s:
        return "same"
    sign = "+" if remedy.extra_time_s > 0 else "−"
    return f"{sign} {duration_text(abs(remedy.extra_time_s))}"


def _percent(fraction: float) -> str:
    if not fraction < 10:
        return "> 1000 %"
    percent = 100 * fraction
    return f"{percent:.0f} %" if percent >= 100 else f"{percent:.2g} %"
