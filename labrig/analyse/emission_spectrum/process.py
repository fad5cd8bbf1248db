"""From the frames of an emission_spectrum run to Λ* of each patch, and whether it is one at all."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.clean import cleaned
from labrig.analyse.emission_file import EmissionSpectrum, write_emission_spectrum
from labrig.analyse.emission_spectrum.bench import SpectralBench, spectral_benches, with_white
from labrig.analyse.emission_spectrum.constancy import compared, over_time
from labrig.analyse.emission_spectrum.picture import Picture, Pictures, combined, visible
from labrig.analyse.emission_spectrum.reading import Reading, read_places
from labrig.analyse.emission_spectrum.telling import (
    comparison_lines,
    peak_line,
    sections,
    verdicts,
)
from labrig.analyse.inputs import Inputs
from labrig.analyse.part import Part, StageResult
from labrig.analyse.strip_patches import StripPatch
from labrig.analyse.this_camera import insist_on_this_camera
from labrig.analyse.timed_frames import intact_frames, steady_frames, timing_warnings
from labrig.errors import DataError, FitError
from labrig.fit.spectrum import fit_spectrum
from labrig.reduce import SeriesFrame
from labrig.results import is_usable

FloatArray = NDArray[np.float64]

#: Draws of the spectra that are only shown.
FEW_SAMPLES = 60
#: After another lamp the glow must be so much brighter than what was left of the one before.
CHARGED_ANEW = 1.05


@dataclass(frozen=True, eq=False)
class _Charge:
    """The glow after one charge: its frames, and all of them as one picture."""

    lamp: str
    frames: Pictures
    picture: Picture


def process(part: Part) -> StageResult:
    """Λ* of every patch with its credible band, whether it is constant, or depends on the lamp.

    Raises
    ------
    UsageError
        No calibrated LVF, no camera curves.
    DataError
        No spectrum is complete, frames are damaged, nothing glows in them, or no patch lies below
        the filter.
    FitError
        Too much clips.
    """
    intact = intact_frames(part.run, part.choices, "spectrum")
    frames, stray = cleaned(intact, part.inputs.blank)
    insist_on_this_camera(part.inputs.camera, part.run, part.run.frames("spectrum"))
    benches, refused = spectral_benches(part, frames.decay[0])
    white = steady_frames(part.run, part.choices, "white")
    readings = read_places(
        [*frames.decay, *white],
        frames.dark,
        {patch: bench.slices for patch, bench in benches.items()},
        part.inputs.camera,
        next(iter(benches.values())).holder,
    )
    found = _of_each(
        list(benches),
        part.inputs,
        lambda patch, known: _of_patch(
            part, patch, known, benches[patch], readings[patch], frames.decay, white=bool(white)
        ),
    )
    told = (
        *timing_warnings(part.run, "spectrum"),
        *stray,
        *refused,
    )
    return replace(found, warnings=(*told, *found.warnings))


def _of_each(
    patches: Sequence[StripPatch],
    known: Inputs,
    process: Callable[[StripPatch, Inputs], StageResult],
) -> StageResult:
    """What `process` finds of every patch, what is known growing from one to the next.

    A patch that cannot be processed is a warning, as long as another one can.

    Raises
    ------
    DataError, FitError
        No patch can.
    """
    if len(patches) == 1 and patches[0].alone:
        return process(patches[0], known)
    found, failures = StageResult(known), []
    for patch in patches:
        name = patch.name
        try:
            one = process(patch, found.known)
        except (DataError, FitError) as error:
            failures.append(type(error)(f"{name}: {error}"))
            found = replace(found, warnings=(*found.warnings, str(failures[-1])))
            continue
        titled = (replace(section, title=f"{section.title}: {name}") for section in one.sections)
        found = StageResult(
            known=one.known,
            sections=(*found.sections, *titled),
            lines=(*found.lines, *(f"{name}: {line}" for line in one.lines)),
            warnings=(*found.warnings, *(f"{name}: {warning}" for warning in one.warnings)),
        )
    if len(failures) == len(patches):
        raise failures[0]
    return found


def _of_patch(
    part: Part,
    patch: StripPatch,
    known: Inputs,
    bench: SpectralBench,
    read: Reading,
    frames: Sequence[SeriesFrame],
    *,
    white: bool,
) -> StageResult:
    bench, warnings = with_white(bench, part, read.pictures("white") if white else None)
    charges: list[_Charge] = []
    dead: list[str] = []
    for unit in dict.fromkeys(frame.unit for frame in frames):
        lamp = unit.removeprefix("spectrum-")
        try:
            pictures = visible(read.pictures(unit))
        except DataError:
            if not charges:
                raise
            dead.append(f"after charging with the {lamp} lamp nothing glows: it did not light")
            continue
        charges.append(_Charge(lamp, pictures, combined(pictures)))

    def spectrum_of(picture: Picture, lamp: str, samples: int = 400) -> EmissionSpectrum:
        fit = fit_spectrum(picture.value, picture.sigma, bench.system, samples=samples)
        run = part.run.folder.resolve().name
        return EmissionSpectrum.of(fit, patch.material, lamp, run)

    first = charges[0]
    spectrum = spectrum_of(first.picture, first.lamp)
    place = part.folder / patch.folder
    place.mkdir(exist_ok=True)
    write_emission_spectrum(place / "emission.yaml", spectrum)
    spectrum.write_csv(place / "spectrum.csv")
    times = over_time(first.frames, bench.centre_nm) if len(first.frames) > 1 else []
    lamps = [
        compared(f"{other.lamp} against {first.lamp}", other.frames, first.picture, bench.centre_nm)
        for other in charges[1:]
    ]
    parts = {
        f"{t_s:.3g} s": spectrum_of(combined(first.frames.take([row])), first.lamp, FEW_SAMPLES)
        for row, t_s in enumerate(first.frames.t_s)
    }
    by_lamp = {one.lamp: spectrum_of(one.picture, one.lamp, FEW_SAMPLES) for one in charges}
    return StageResult(
        known=replace(known, spectra={**known.spectra, patch.folder: spectrum}),
        sections=tuple(sections(spectrum, bench, first.frames, times, parts, lamps, by_lamp)),
        lines=(peak_line(spectrum), *comparison_lines(times, lamps)),
        warnings=(
            *warnings,
            *_clipping(first.frames),
            *_faint(len(first.frames), frames),
            *verdicts(times, lamps),
            *_not_charged(charges),
            *dead,
        ),
    )


def _not_charged(charges: Sequence[_Charge]) -> list[str]:
    """Lamps after which the glow went on fading as if they had not been lit."""
    told = []
    for before, after in pairwise(charges):
        seen = np.isfinite(before.picture.value) & np.isfinite(after.picture.value)
        left = before.picture.value[seen] * before.picture.brightness[-1]
        anew = after.picture.value[seen]
        if float(anew @ left) < CHARGED_ANEW * float(left @ left):
            told.append(
                f"after charging with the {after.lamp} lamp the glow is no brighter than what was "
                f"left before: the {after.lamp} lamp did not light, or hardly excites this sample"
            )
    return told


def _faint(count: int, frames: Sequence[SeriesFrame]) -> list[str]:
    taken = sum(one.unit == frames[0].unit and is_usable(one.flag) for one in frames)
    if count == taken:
        return []
    return [
        f"{taken - count} of {taken} frames show no light above the noise and are left out; "
        "photograph earlier (times:), or charge for longer"
    ]


def _clipping(frames: Pictures) -> list[str]:
    clipped = np.isnan(frames.value)
    if not clipped.any():
        return []
    lost = int(clipped.all(axis=0).sum())
    return [
        f"{clipped.mean():.0%} of the values clip and are left out, {lost} of "
        f"{clipped.shape[1]} in every frame; expose for less or lower the ISO"
    ]
