"""A decay run, from its folder to its result: the way of a photon's number, in one function."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from labrig.acquire import read_rig_file
from labrig.errors import FitError
from labrig.fit import DecayFit
from labrig.process.choices import Choices, DecayProtocol, read_decay_protocol
from labrig.process.page import run_report
from labrig.process.result_folder import replaced_result, write_patch
from labrig.process.series_fit import fit_series
from labrig.process.timed_frames import dark_frames, decay_frames, timing_warnings
from labrig.record import read_run
from labrig.reduce import Series, reduce_patches
from labrig.report import write_report


@dataclass(frozen=True)
class Result:
    """What came out of a run; series and fits by the name of their patch.

    Each fit has warnings of its own; `run_warnings` are about everything before the fits.
    """

    report: Path
    series: Mapping[str, Series]
    fits: Mapping[str, DecayFit]
    run_warnings: tuple[str, ...]


def process_run(folder: Path, choices: Choices | None = None) -> Result:
    """Reduce and fit the run in `folder`, write `result/` and the report in it.

    Earlier results are kept as `result-1`, `result-2`, …

    Raises
    ------
    UsageError
        Not a run folder, or a choice that does not fit it.
    DataError
        No decay is complete, or a frame was changed after the run.
    FitError
        No patch could be fitted; series and report are written all the same.
    """
    folder, choices = Path(folder), choices or Choices()
    protocol, rig = read_decay_protocol(folder), read_rig_file(folder / "rig.yaml")
    run = read_run(folder)
    choices.check([frame for attempt in run.completed().values() for frame in attempt.frames])

    patches = choices.patches(protocol)
    series = reduce_patches(
        decay_frames(run, choices),
        patches,
        dark_frames(run, choices),
        protocol.background if protocol.dark == "background" else None,
    )
    fits = _fit_all(series, choices.states or _asked_states(protocol))
    run_warnings = (*timing_warnings(run), *_clipping_warnings(series))
    warnings = (*run_warnings, *_fit_warnings(fits))

    with replaced_result(folder) as made:
        for name, fit in fits.items():
            place = made if len(fits) == 1 else made / name
            material = protocol.sample.name if len(fits) == 1 else name
            write_patch(place, series[name], fit, material, folder.name)
        page = run_report(run, protocol, rig, patches, series, fits, warnings)
        write_report(made / "report.html", page)

    report = folder / "result" / "report.html"
    fitted = {name: fit for name, fit in fits.items() if isinstance(fit, DecayFit)}
    if not fitted:
        raise FitError(f"{'; '.join(map(str, fits.values()))}; the run is kept, see {report}")
    return Result(report, series, fitted, run_warnings)


def _fit_all(series: Mapping[str, Series], states: int | None) -> dict[str, DecayFit | str]:
    """Fits by patch. Shutter and aperture flicker alike for all patches of a frame, so the patch
    that tells their flicker best tells it for those that are dim or fade within a few frames.
    """
    fits = {name: _fit(one, states, None) for name, one in series.items()}
    measured = [fit for fit in fits.values() if isinstance(fit, DecayFit) and fit.flicker > 0]
    if len(fits) == 1 or not measured:
        return fits
    best = min(measured, key=lambda fit: fit.flicker_sigma / fit.flicker)
    return {
        name: fit if fit is best else _fit(series[name], states, best.flicker)
        for name, fit in fits.items()
    }


def _fit(series: Series, states: int | None, flicker: float | None) -> DecayFit | str:
    """The fit, or why there is none."""
    try:
        return fit_series(series, states, flicker=flicker)
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


def _fit_warnings(fits: Mapping[str, DecayFit | str]) -> Iterator[str]:
    for name, fit in fits.items():
        said = [f"not fitted: {fit}"] if isinstance(fit, str) else fit.warnings
        yield from (f"{_patch(name, fits)}{text}" for text in said)


def _patch(name: str, patches: Mapping[str, object]) -> str:
    return f"{name}: " if len(patches) > 1 else ""
