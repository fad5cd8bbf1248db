"""Run folder → reduce → fit → material → report."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Literal, Protocol, Self, cast

from labrig.acquire import RigFile, Sample, plugins, read_rig_file
from labrig.errors import DataError, FitError, UsageError
from labrig.fit import DecayFit
from labrig.material.file import Material, Provenance, State, write_material
from labrig.record import Attempt, FrameRecord, RunRecord, read_run
from labrig.reduce import Series, SeriesFrame, add_flag, reduce_patches, write_series
from labrig.region import Region, parse_region
#REPORT from labrig.report import RunReport, write_report
from labrig.series_fit import fit_series
from labrig.yaml_file import did_you_mean

#: A frame later than this after its planned time is worth a warning; its measured time is used.
LATE_S = 0.05


class DecayProtocol(Protocol):
    """The keys of a protocol that its processing needs."""

    sample: Sample
    patches: dict[str, Region]
    background: Region | None
    dark: Literal["frames", "background"]
    states: Literal["auto", 1, 2, 3]


@dataclass(frozen=True)
class Choices:
    """What a person wants otherwise than the protocol says.

    Attributes
    ----------
    regions
        Patch name → region; the name "" stands for the only patch there is.
    excluded
        Frames to leave out, by file name or number.
    states
        Number of states; None leaves it to the protocol.
    """

    regions: Mapping[str, Region] = field(default_factory=dict)
    excluded: frozenset[str] = frozenset()
    states: int | None = None

    @classmethod
    def parse(cls, regions: Sequence[str], excluded: Sequence[str], states: int | None) -> Self:
        """From the texts of a command line: `NAME=x,y,w,h` or `x,y,w,h`, frame numbers or names.

        Raises
        ------
        UsageError
            A region that is none.
        """
        named = {}
        for text in regions:
            name, _, numbers = text.rpartition("=")
            named[name] = parse_region(numbers)
        return cls(named, frozenset(excluded), states)


@dataclass(frozen=True)
class Result:
    """What came out of a run."""

    folder: Path
    report: Path
    series: Mapping[str, Series]
    fits: Mapping[str, DecayFit]
    failures: Mapping[str, str]
    warnings: tuple[str, ...]


def process_run(folder: Path, choices: Choices | None = None) -> Result:
    """Reduce and fit the run in `folder`, write `result/` and the report in it.

    Earlier results are kept as `result-1`, `result-2`, …

    Raises
    ------
    UsageError
        Not a run folder, or a choice that does not fit it.
    DataError
        No decay is complete.
    FitError
        No patch could be fitted; series and report are written all the same.
    """
    choices = choices or Choices()
    run = read_run(folder)
    protocol = _decay_protocol(folder)
    rig = read_rig_file(folder / "rig.yaml")
    patches = _patches(protocol, choices)
    frames, warnings = _decay_frames(run, choices)
    darks = [_dark_frame(frame) for frame in run.frames("dark")]
    series = reduce_patches(frames, patches, darks, protocol.background)
    warnings += _series_warnings(series)
    fits, failures = _fit(series, protocol, choices)
    warnings += [f"{_who(name, series)}{text}" for name, fit in fits.items() for text in fit.warnings]
    result = Result(folder, folder / "result" / "report.html", series, fits, failures, tuple(warnings))
    _write(result, run, protocol, rig, patches)
    if not fits:
        raise FitError("; ".join(failures.values()) + f"; see {result.report}")
    return result


def _decay_protocol(folder: Path) -> DecayProtocol:
    protocol = plugins.read_protocol(folder / "protocol.yaml")
    if protocol.protocol != "decay":
        raise UsageError(f"{folder}: expected a run of 'decay', got one of '{protocol.protocol}'")
    return cast(DecayProtocol, protocol)


def _patches(protocol: DecayProtocol, choices: Choices) -> dict[str, Region]:
    patches = dict(protocol.patches)
    for name, region in choices.regions.items():
        if not name and len(patches) == 1:
            name = next(iter(patches))
        if name not in patches:
            raise UsageError(
                f"--roi: no patch is called '{name}'; {did_you_mean(name, list(patches))}; write "
                "--roi NAME=x,y,width,height"
            )
        patches[name] = region
    return patches


def _decay_frames(run: RunRecord, choices: Choices) -> tuple[list[SeriesFrame], list[str]]:
    """Frames of all completed decays with their times after lamp off, and what is odd about them."""
    warnings, frames = [], []
    if run.torn:
        warnings.append("the journal's last line is torn: labrig was cut off while writing it")
    for attempt in run.completed().values():
        for frame in attempt.frames:
            if frame.purpose == "decay":
                found, said = _decay_frame(frame, attempt, choices)
                frames.append(found)
                warnings += said
    if not frames:
        raise DataError(
            f"{run.folder}: no decay is complete, so there is nothing to fit; go on with: "
            f"labrig resume {run.folder}"
        )
    unknown = choices.excluded - {
        known for frame in frames for known in (frame.path.name, str(int(frame.path.stem)))
    }
    if unknown:
        raise UsageError(f"--exclude: no decay frame is called {', '.join(sorted(unknown))}")
    return frames, warnings


def _decay_frame(
    frame: FrameRecord, attempt: Attempt, choices: Choices
) -> tuple[SeriesFrame, list[str]]:
    name, flag, warnings = frame.path.name, "", []
    if choices.excluded & {name, str(int(frame.path.stem))}:
        flag = add_flag(flag, "excluded")
    if not frame.path.is_file() or sha256(frame.path.read_bytes()).hexdigest() != frame.sha256:
        raise DataError(
            f"{frame.path}: the frame is missing or was changed after the run (its checksum "
            "differs); restore it from a copy"
        )
    if frame.late_s > LATE_S:
        flag = add_flag(flag, "late")
        warnings.append(
            f"frame {name} began {frame.late_s:.2f} s late; its measured time is used"
        )
    dark_since = _lamp_off_time(attempt, frame)
    return (
        SeriesFrame(
            frame.path,
            frame.start_time - dark_since,
            frame.exposure_s,
            frame.iso,
            frame.f_number,
            attempt.unit,
            flag,
        ),
        warnings,
    )


def _lamp_off_time(attempt: Attempt, frame: FrameRecord) -> float:
    """Middle of the last lamp-off transaction before the frame: the relay opened somewhere in it."""
    offs = [
        (action.start_time + action.end_time) / 2
        for action in attempt.actions
        if action.device == "lamp" and action.action == "off"
        if action.start_time <= frame.start_time
    ]
    if not offs:
        raise DataError(f"{frame.path}: the journal does not say when the lamp went off before it")
    return offs[-1]


def _dark_frame(frame: FrameRecord) -> SeriesFrame:
    return SeriesFrame(
        frame.path, 0.0, frame.exposure_s, frame.iso, frame.f_number, frame.unit
    )


def _series_warnings(series: Mapping[str, Series]) -> list[str]:
    warnings = []
    for name, one in series.items():
        clipped = sum("clipped" in flag for flag in one.flag)
        if clipped:
            warnings.append(
                f"{_who(name, series)}{clipped} of {len(one.flag)} frames are clipped and left "
                "out; expose for less or lower the ISO"
            )
    return warnings


def _fit(
    series: Mapping[str, Series], protocol: DecayProtocol, choices: Choices
) -> tuple[dict[str, DecayFit], dict[str, str]]:
    asked = None if protocol.states == "auto" else protocol.states
    fits, failures = {}, {}
    for name, one in series.items():
        try:
            fits[name] = fit_series(one, choices.states or asked)
        except FitError as error:
            failures[name] = f"{_who(name, series)}{error}"
    return fits, failures


def _who(name: str, series: Mapping[str, Series]) -> str:
    return f"{name}: " if len(series) > 1 else ""


def _write(
    result: Result,
    run: RunRecord,
    protocol: DecayProtocol,
    rig: RigFile,
    patches: Mapping[str, Region],
) -> None:
    """Make the new result beside the old one, then let it take its name."""
    made = result.folder / "result.part"
    if made.exists():
        shutil.rmtree(made)
    for name, series in result.series.items():
        place = made if len(result.series) == 1 else made / name
        place.mkdir(parents=True)
        write_series(place / "series.csv", [series])
        if name in result.fits:
            (place / "fit.json").write_text(result.fits[name].to_json(), encoding="utf-8")
            write_material(place / "material.yaml", _material(name, result, protocol))
    write_report(made / "report.html", _report(result, run, protocol, rig, patches))
    final = result.folder / "result"
    if final.exists():
        number = 1
        while (result.folder / f"result-{number}").exists():
            number += 1
        final.rename(result.folder / f"result-{number}")
    made.rename(final)


def _material(name: str, result: Result, protocol: DecayProtocol) -> Material:
    """What the decay alone says: rates and amplitudes; r0, k_e and Λ stay unknown."""
    fit = result.fits[name]
    return Material(
        name=protocol.sample.name if len(result.series) == 1 else name,
        kind="phosphor",
        states=tuple(
            State(
                k_r_per_s=state.k_r_per_s,
                k_r_per_s_sigma=state.k_r_sigma_per_s,
                amplitude=state.amplitude,
                amplitude_sigma=state.amplitude_sigma,
            )
            for state in fit.states
        ),
        provenance=Provenance(
            source="decay measured with labrig; amplitudes in DN/s of the brightest channel",
            run=result.folder.name,
            frames=result.series[name].frame,
            version=version("labrig"),
        ),
    )
