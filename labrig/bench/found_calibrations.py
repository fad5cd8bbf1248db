"""Calibrations that are kept beside the runs or the rig file, for a rig whose file names none."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from labrig.acquire import RigFile
from labrig.calibration import (
    CAMERA_KIND,
    LVF_KIND,
    REFERENCE_KIND,
    KeptCalibration,
    kept_calibrations,
    kinds,
)
from labrig.foundation.quantity import duration_text
from labrig.optics import f_number_text


@dataclass(frozen=True)
class FoundCalibrations:
    """A rig with the calibrations that were found for it.

    Attributes
    ----------
    rig
        The rig file with their files under `optics:`.
    kept
        Calibration from which each kind was taken, by the kind's name.
    notes
        What a person should know of them, a line each.
    """

    rig: RigFile
    kept: dict[str, KeptCalibration]
    notes: tuple[str, ...]

    def record(self, now_s: float) -> dict[str, dict[str, str]]:
        """Return file, time and age of each, by the kind's name, for the run's record."""
        return {
            kind: {
                "file": str(each.files()[kind]),
                "made": each.reference.made.isoformat(),
                "age": duration_text(each.reference.age_s(now_s)),
            }
            for kind, each in self.kept.items()
        }

    def without_apertures(self, f_numbers: Collection[float]) -> Self:
        """Return this without a camera's calibration that lacks one of these apertures.

        Frames at another aperture would be refused later, when the run is over.

        Raises
        ------
        UsageError
            The camera's calibration is malformed.
        """
        kept = self.kept.get(CAMERA_KIND.name)
        if kept is None:
            return self
        camera = CAMERA_KIND.read(kept.files()[CAMERA_KIND.name])
        missing = [f_number for f_number in f_numbers if camera.flat_at(f_number) is None]
        if not missing:
            return self
        optics = self.rig.optics.model_copy(update={CAMERA_KIND.optics_key: None})
        note = (
            f"{CAMERA_KIND.name} of the calibration {kept.folder.name} is not used: it has no flat "
            f"field at {f_number_text(missing[0])} (f_numbers of camera_calibration)"
        )
        return replace(
            self,
            rig=self.rig.model_copy(update={"optics": optics}),
            kept={name: each for name, each in self.kept.items() if name != CAMERA_KIND.name},
            notes=(*self.notes, note),
        )


def find_calibrations(
    rig: RigFile, beside: Collection[Path], now_s: float, measured: str = ""
) -> FoundCalibrations:
    """Find calibrations for what a rig file names none of: of each kind the newest of this bench.

    Parameters
    ----------
    rig
        The rig file; its `calibrations:` says how old they may be.
    beside
        Folders that may have a folder `calibrations`: that of the run folders, that of the rig
        file.
    now_s
        Present time in seconds since 1970.
    measured
        Name of the protocol that is to run: what it measures anew is not looked for.

    Raises
    ------
    UsageError
        A kept calibration is malformed.
    """
    if not rig.calibrations.find:
        return FoundCalibrations(rig, {}, ())
    wanted = [
        kind for kind in kinds() if rig.optics.named(kind) is None and kind.protocol != measured
    ]
    kept: dict[str, KeptCalibration] = {}
    notes: list[str] = []
    for each in kept_calibrations(*beside):
        if each.reference.bench != rig.name:
            continue
        reason = _refused(each, rig, now_s)
        if reason is not None:
            notes.append(f"the calibration {each.folder.name} is not used: {reason}")
            continue
        kept = dict.fromkeys(each.files(), each) | kept
    if LVF_KIND.name in kept:
        kept[REFERENCE_KIND.name] = kept[LVF_KIND.name]  # its picture belongs to that filter
    found = {kind.name: kept[kind.name] for kind in wanted if kind.name in kept}
    if REFERENCE_KIND.name in found and len(found) == 1:
        found = {}  # all that it belongs to is named by the rig file
    files = {
        kind.optics_key: str(found[kind.name].files()[kind.name].resolve())
        for kind in wanted
        if kind.name in found
    }
    notes += _notes(found, rig, now_s)
    optics = rig.optics.model_copy(update=files)
    return FoundCalibrations(rig.model_copy(update={"optics": optics}), found, tuple(notes))


def _refused(kept: KeptCalibration, rig: RigFile, now_s: float) -> str | None:
    """Return why a calibration of this bench does not hold for its rig file; None if it does."""
    reference, optics = kept.reference, rig.optics
    for what, theirs, ours in (
        ("the lamp", reference.lamp, optics.lamp),
        ("the grey card", reference.grey_card, optics.grey_card),
        ("the camera's curves", reference.curves, optics.camera),
    ):
        if theirs != ours:
            return f"{what} was {theirs or 'not named'}, now it is {ours or 'not named'}"
    rules = rig.calibrations
    age_s = reference.age_s(now_s)
    if age_s > rules.at_most_age and "age" not in rules.only_warn:
        return f"it is {duration_text(age_s)} old, more than {duration_text(rules.at_most_age)}"
    return None


def _notes(found: dict[str, KeptCalibration], rig: RigFile, now_s: float) -> Iterator[str]:
    """Yield what is used of each calibration, and that one is old."""
    for each in dict.fromkeys(found.values()):
        names = [name for name in found if found[name] is each and name != REFERENCE_KIND.name]
        age_s = each.reference.age_s(now_s)
        yield (
            f"{', '.join(names)} of the calibration {each.folder.name}, {duration_text(age_s)} "
            f"old ({each.folder})"
        )
        if age_s > rig.calibrations.at_most_age:
            yield (
                f"the calibration {each.folder.name} is {duration_text(age_s)} old, more than "
                f"{duration_text(rig.calibrations.at_most_age)}: make another one soon (labrig run "
                "calibration)"
            )
