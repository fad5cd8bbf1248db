"""Check that a run is as it was recorded and sealed: journal, frames, result, signature."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from labrig.acquire import read_run_protocol, read_run_rig
from labrig.analyse import (
    clock_warnings,
    settings_differences,
    spectra_differences,
)
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.yaml_file import read_model
from labrig.process.comparison import LOCK
from labrig.process.provenance import PROVENANCE, Provenance
from labrig.record import (
    JOURNAL,
    RECORDING_LOCK,
    RunLock,
    RunRecord,
    damaged_frames,
    edited_keys,
    line_seals,
    read_run,
)
from labrig.seal import (
    SEAL,
    LabKey,
    RunSeal,
    Signers,
    list_files,
    read_seal,
    write_seal,
)

#: Files that grow when a run goes on.
_GROWING = (JOURNAL, "log.txt")


@dataclass(frozen=True)
class Verification:
    """Outcome of the check of a run.

    Attributes
    ----------
    intact
        What is as it was recorded, in lines for people.
    changed
        What is not, in lines for people.
    doubtful
        What may have been changed, with numbers, in lines for people.
    journal
        Seal of the journal: SHA-256 of its last line; empty if it cannot be read.
    seal
        Seal with a valid signature; None for an unsealed run and for a broken seal.
    signer
        Name of the laboratory whose key signed, from a file at hand; None for an unknown key.
    is_seal_broken
        Whether there is a seal whose signature is not valid.
    """

    intact: tuple[str, ...]
    changed: tuple[str, ...]
    doubtful: tuple[str, ...] = ()
    journal: str = ""
    seal: RunSeal | None = None
    signer: str | None = None
    is_seal_broken: bool = False

    @property
    def is_intact(self) -> bool:
        """True if nothing was changed."""
        return not self.changed

    @property
    def status(self) -> str:
        """Status in one word: `changed`, `sealed` or `unsealed`."""
        if self.changed:
            return "changed"
        return "unsealed" if self.seal is None else "sealed"

    @property
    def seal_line(self) -> str:
        """The seal's author and time, or that there is none, in a line for people."""
        if self.is_seal_broken:
            return "seal: broken, it shows nothing"
        if self.seal is None:
            return "seal: unsealed, no laboratory has signed this run (labrig seal RUN)"
        files, fingerprint = self.seal.files, self.seal.signer.fingerprint
        if self.signer is not None:
            by = f"{self.signer} ({fingerprint})"
        else:
            by = (
                f"an unknown key ({fingerprint}) that calls itself '{files.by}': compare the "
                "fingerprint with one that you have from the laboratory itself, or give --signers"
            )
        return f"seal: signature valid; sealed {files.sealed}, {len(files.sha256)} files, by {by}"


def verify_run(folder: Path, signers: Signers | None = None) -> Verification:
    """Check the journal of a run, its frames, its result and its seal.

    The journal is chained by the SHA-256 of each line in the next one, frames by theirs in the
    journal, and a result by that of the journal's last line. Settings and times in the journal are
    compared with what the camera wrote into the RAW files. A seal adds the signature of a
    laboratory; without one, all of it can be forged together.

    Parameters
    ----------
    folder
        Run folder.
    signers
        Laboratories whose keys are at hand.

    Returns
    -------
    Verification
        What is intact, with the journal's seal, what was changed, and who sealed the run.

    Raises
    ------
    DiskError
        Something cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.process import verify_run
    >>> verify_run(Path("runs/decay")).status
    'unsealed'
    """
    intact: list[str] = []
    changed: list[str] = []
    doubtful: list[str] = []
    seal, journal, is_broken = None, "", False
    try:
        run = read_run(folder)
    except DataError as error:
        changed.append(str(error))
    else:
        journal = run.seal
        _check_content(run, intact, changed, doubtful)
    try:
        seal = read_seal(folder)
    except DataError as error:
        changed.append(str(error))
        is_broken = True
    if seal is not None:
        went_on = journal != "" and seal.files.journal in line_seals(folder / JOURNAL)
        changed += _changes_since(folder, seal, went_on=went_on)
    signer = None if seal is None or signers is None else signers.name_of(seal.signer)
    return Verification(
        tuple(intact), tuple(changed), tuple(doubtful), journal, seal, signer, is_broken
    )


def seal_run(folder: Path, key: LabKey, time_s: float) -> RunSeal:
    """Check a run as `verify_run` does, and sign the list of its files.

    An earlier seal is replaced, as after a run was processed again.

    Parameters
    ----------
    folder
        Run folder.
    key
        Key of the laboratory.
    time_s
        Time in seconds since 1970.

    Returns
    -------
    RunSeal
        The new seal.

    Raises
    ------
    UsageError
        Another labrig records into the run or processes it.
    DataError
        Journal, frames or result are not as they were recorded.
    DiskError
        Something cannot be read or written.

    Examples
    --------
    >>> import shutil
    >>> from pathlib import Path
    >>> from labrig.process import seal_run, verify_run
    >>> from labrig.seal import create_key, read_signers
    >>> key = create_key(Path("lab_key"), "Example lab")
    >>> run = Path(shutil.copytree("runs/decay", "cited"))
    >>> seal = seal_run(run, key, 1_767_225_600.0)
    >>> verification = verify_run(run, read_signers(Path("lab_key.pub")))
    >>> verification.status, verification.signer
    ('sealed', 'Example lab')
    """
    with ExitStack() as locks:
        locks.enter_context(RunLock(folder / RECORDING_LOCK, "writing to this run"))
        locks.enter_context(RunLock(folder / LOCK, "processing this run"))
        run, changed = read_run(folder), list[str]()
        _check_content(run, [], changed, [])
        if changed:
            raise DataError(f"{folder}: cannot be sealed: {'; '.join(changed)}")
        return write_seal(folder, key, run.seal, time_s)


def require_as_sealed(folder: Path) -> None:
    """Refuse a sealed run whose journal, protocol or rig file are not those that were sealed.

    Frames are covered by their checksums in the journal. A run that went on, or was never sealed,
    is not refused.

    Raises
    ------
    DataError
        The seal is broken, or something was changed.
    """
    seal = read_seal(folder)
    if seal is None:
        return
    sealed = seal.files.sha256
    now = list_files(folder, ("protocol.yaml", "rig.yaml", "calibrations.yaml", JOURNAL))
    changed = [name for name in now if now[name] != sealed.get(name)]
    if JOURNAL in changed and seal.files.journal in line_seals(folder / JOURNAL):
        changed.remove(JOURNAL)
    if changed:
        raise DataError(
            f"{folder}: {', '.join(changed)} changed since {seal.files.by} sealed the run "
            f"{seal.files.sealed}; restore the files from a copy, or delete {SEAL} to go on without"
        )


def _check_content(
    run: RunRecord, intact: list[str], changed: list[str], doubtful: list[str]
) -> None:
    """Add what is intact, changed and doubtful of journal, frames and result, in lines."""
    folder = run.folder
    files = [file for attempt in run.attempts for file in attempt.files]
    damaged = damaged_frames(folder, files, trust=False)
    changed += [f"{file.path} {damage}" for file, damage in damaged.items()]
    intact += [
        f"journal: every line follows the one before; seal {run.seal}",
        f"frames: {len(files) - len(damaged)} of {len(files)} have the checksums of the journal",
    ]
    differences = list(_differences(run))
    changed += differences
    doubtful += map(str, clock_warnings(run))
    if not differences and not doubtful:
        intact.append("settings and times of the frames are those in their files")
    path = folder / "result" / PROVENANCE
    if not path.exists():
        return
    try:
        is_of_journal = read_model(path, Provenance).journal == run.seal
    except UsageError as error:
        changed.append(str(error))
        return
    if is_of_journal:
        intact.append(f"{path.parent}: the result is of this journal")
    else:
        changed.append(f"{path.parent}: the result is of another journal; labrig process {folder}")


def _differences(run: RunRecord) -> Iterator[str]:
    """Yield how settings in the journal differ from those in the files."""
    frames = [frame for attempt in run.attempts for frame in attempt.frames]
    spectra = [spectrum for attempt in run.attempts for spectrum in attempt.spectra]
    try:
        rig, protocol = read_run_rig(run.folder), read_run_protocol(run.folder)
    except UsageError as error:
        yield str(error)
        return
    yield from (f"{run.folder}: {line}" for line in edited_keys(run.folder))
    asked = {"protocol": protocol.protocol, "sample": protocol.sample.name, "rig": rig.name}
    for key, value in asked.items():
        if others := {attempt.start.get(key, value) for attempt in run.attempts} - {value}:
            other = others.pop()
            yield f"{run.folder}: the {key} is {value!r} in its file, {other!r} in the journal"
    for frame, text in settings_differences(run, rig, frames).items():
        yield f"{frame.path} has {text}"
    for spectrum, text in spectra_differences(spectra).items():
        yield f"{spectrum.path} has {text}"


def _changes_since(folder: Path, seal: RunSeal, *, went_on: bool) -> Iterator[str]:
    """Yield what was changed since the seal; `went_on`: the sealed journal begins that of now."""
    now = list_files(folder)
    added = now.keys() - seal.files.sha256.keys()
    if went_on and now[JOURNAL] != seal.files.sha256.get(JOURNAL):
        yield (
            f"{folder}: the run went on after it was sealed, with {len(added)} new files; labrig "
            "seal seals it anew"
        )
        now = {name: sha256 for name, sha256 in now.items() if name not in added}
        now |= {name: seal.files.sha256[name] for name in seal.files.sha256.keys() & _GROWING}
    for change in seal.changes(now):
        yield f"{folder}: {change}"
