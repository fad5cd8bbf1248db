"""A decay run, from its folder to its result: the way of a photon's number, in one function."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from labrig.analyse.choices import Choices, DecayProtocol, read_decay_protocol
from labrig.analyse.clean import cleaned
from labrig.analyse.inputs import Inputs
from labrig.analyse.series_fit import fit_series
from labrig.analyse.temperature import glow_temperature_c, temperature_warnings
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import IntactFrames, intact_frames, timing_warnings
from labrig.errors import FitError
from labrig.export import write_nexus
from labrig.fit import DecayFit
from labrig.process.page import camera_response, run_name, run_report
from labrig.process.provenance import provenance
from labrig.process.result import Result
from labrig.process.result_folder import (
    new_result,
    put_in_place,
    write_patch,
    write_provenance,
)
from labrig.record import RunRecord, read_run
from labrig.reduce import reduce_patches
from labrig.region import Region
from labrig.report import write_report
from labrig.results import Series


def process_decay(folder: Path, choices: Choices) -> Result:
    """As `process_run`, of a decay.

    Raises
    ------
    DataError
        No decay is complete, or a frame is missing or was changed after the run.
    FitError
        No patch could be fitted; series and report are written all the same.
    """
    protocol, rig = read_decay_protocol(folder), choices.bench(folder)
    run = read_run(folder)
    recorded = [frame for attempt in run.completed().values() for frame in attempt.frames]
    choices.check(recorded)

    measured = measure_decay(run, protocol, choices, Inputs.of(rig))
    patches, background, frames = measured.patches, measured.background, measured.frames
    series, fits = measured.series, measured.fits
    states = choices.states or _asked_states(protocol)
    camera, unknown_camera = camera_response(rig, choices.camera)
    run_warnings = (*measured.run_warnings, *unknown_camera, *temperature_warnings(run))
    warnings = (*run_warnings, *fit_warnings(fits))

    made = new_result(folder)
    write_provenance(
        made,
        provenance(
            protocol,
            choices,
            patches,
            background,
            frames,
            recorded,
            camera.name if camera else None,
        ),
    )
    warmth_c = glow_temperature_c(run)
    for name, fit in fits.items():
        place = made if len(fits) == 1 else made / name
        material = protocol.sample.name if len(fits) == 1 else name
        write_patch(place, series[name], fit, material, run_name(run), warmth_c)
    page = run_report(
        run, protocol, rig, patches, series, fits, warnings, frames.daylight, camera, states
    )
    write_report(made / "report.html", page)
    write_nexus(made / "run.nxs", run, page)
    changes = put_in_place(made)

    report = folder / "result" / "report.html"
    fitted = {name: fit for name, fit in fits.items() if isinstance(fit, DecayFit)}
    if not fitted:
        raise FitError(f"{'; '.join(map(str, fits.values()))}; the run is kept, see {report}")
    lines = tuple(f"{name}\n{fit}" for name, fit in fitted.items())
    return Result(report, lines, run_warnings, changes, series, fitted)


@dataclass(frozen=True)
class MeasuredDecay:
    """A decay reduced and fitted; a fit that failed is the reason why."""

    patches: Mapping[str, Region]
    background: Region | None
    frames: IntactFrames
    series: Mapping[str, Series]
    fits: Mapping[str, DecayFit | str]
    run_warnings: tuple[str, ...]


def measure_decay(
    run: RunRecord, protocol: DecayProtocol, choices: Choices, known: Inputs
) -> MeasuredDecay:
    """From the frames of a decay to a fit of every patch.

    Raises
    ------
    DataError
        No decay is complete, a frame is missing or was changed after the run, or the camera file
        that is `known` is of another camera, lens or aperture.
    """
    patches = choices.patches(protocol)
    background = protocol.background if protocol.dark == "background" else None
    frames, stray = cleaned(intact_frames(run, choices), known.blank)
    insist_on_this_camera(known.camera, run, run.frames("decay"))
    series = reduce_patches(frames.decay, patches, frames.dark, background, known.camera)
    fits = _fit_all(series, choices.states or _asked_states(protocol), choices.fixed_rates_per_s)
    warnings = (*timing_warnings(run), *frames.warnings, *stray, *_clipping_warnings(series))
    return MeasuredDecay(patches, background, frames, series, fits, warnings)


def _fit_all(
    series: Mapping[str, Series], states: int | None, fixed_rates_per_s: Sequence[float]
) -> dict[str, DecayFit | str]:
    """Fits by patch. Shutter and aperture flicker alike for all patches of a frame, so the patch
    that tells their flicker best tells it for those that are dim or fade within a few frames.
    """
    fits = {name: _fit(one, states, fixed_rates_per_s, None) for name, one in series.items()}
    measured = [fit for fit in fits.values() if isinstance(fit, DecayFit) and fit.flicker > 0]
    if len(fits) == 1 or not measured:
        return fits
    best = min(measured, key=lambda fit: fit.flicker_sigma / fit.flicker)
    return {
        name: (fit if fit is best else _fit(series[name], states, fixed_rates_per_s, best.flicker))
        for name, fit in fits.items()
    }


def _fit(
    series: Series,
    states: int | None,
    fixed_rates_per_s: Sequence[float],
    flicker: float | None,
) -> DecayFit | str:
    """The fit, or why there is none."""
    try:
        return fit_series(series, states, flicker=flicker, fixed_rates_per_s=fixed_rates_per_s)
    except FitError as error:
        return str(error)


def _asked_states(protocol: DecayProtocol) -> int | None:
    return None if protocol.states == "auto" else protocol.states


def _clipping_warnings(series: Mapping[str, Series]) -> Iterator[str]:
    for name, one in series.items():
        clipped = sum("clipped" in flag for flag in one.flag)
        if clipped:
            yield (
                f"{_patch(name, series)}{clipped} of {len(one.flag)} frames are clipped and left "
                "out; expose for less or lower the ISO"
            )


def fit_warnings(fits: Mapping[str, DecayFit | str]) -> Iterator[str]:
    """What fits warn of, with the names of patches where there are several."""
    for name, fit in fits.items():
        said = [f"not fitted: {fit}"] if isinstance(fit, str) else fit.warnings
        yield from (f"{_patch(name, fits)}{text}" for text in said)


def _patch(name: str, patches: Mapping[str, object]) -> str:
    return f"{name}: " if len(patches) > 1 else ""
