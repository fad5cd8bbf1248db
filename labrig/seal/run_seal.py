"""The seal of a run: the list of its files and the signature of that list, beside the journal."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.input_file import MAX_TEXT_BYTES, read_bytes, read_text
from labrig.foundation.output_file import write_text
from labrig.seal.file_list import FileList, list_files
from labrig.seal.lab_key import LabKey
from labrig.seal.signature import PublicKey, signature_text, signer_of

#: Files of the list and of its signature in a run folder.
SEAL = "seal.sha256"
SIGNATURE = f"{SEAL}.sig"
_MOST_SIGNATURE_BYTES = 10_000


@dataclass(frozen=True)
class RunSeal:
    """A seal whose signature is that of its list.

    Attributes
    ----------
    files
        Files of the run when it was sealed.
    signer
        Key that signed the list.
    """

    files: FileList
    signer: PublicKey

    def changes(self, sha256: Mapping[str, str]) -> Iterator[str]:
        """Yield what is no longer as it was sealed, in lines for people.

        Parameters
        ----------
        sha256
            Checksums of the run's files now, as `list_files` returns them.
        """
        sealed = self.files.sha256
        for name in sorted({*sealed, *sha256}):
            if name not in sha256:
                yield f"{name} was removed since the seal"
            elif name not in sealed:
                yield f"{name} was added since the seal"
            elif sealed[name] != sha256[name]:
                yield f"{name} was changed since the seal"


def write_seal(folder: Path, key: LabKey, journal: str, time_s: float) -> RunSeal:
    """List the files of a run, sign the list, and write both into the run folder.

    An earlier seal is replaced.

    Parameters
    ----------
    folder
        Run folder.
    key
        Key of the laboratory.
    journal
        Seal of the run's journal.
    time_s
        Time in seconds since 1970.

    Returns
    -------
    RunSeal
        The new seal.

    Raises
    ------
    DataError
        A file's name cannot be written in a list.
    DiskError
        A file cannot be read, or the seal cannot be written.

    Examples
    --------
    >>> import shutil
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.seal import create_key, write_seal
    >>> run = labrig.read_run(shutil.copytree("runs/decay", "signed"))
    >>> key = create_key(Path("settings/of_this_lab"), "Example lab")
    >>> write_seal(run.folder, key, run.seal, 1_767_225_600.0).files.sealed
    '2026-01-01T00:00:00Z'
    """
    files = FileList(
        sha256=list_files(folder),
        journal=journal,
        run=" ".join(folder.resolve().name.split()),
        by=key.name,
        sealed=datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        labrig=version("labrig"),
    )
    text = files.text()
    write_text(folder / SEAL, text)
    write_text(folder / SIGNATURE, signature_text(text.encode(), key.private))
    return RunSeal(files, key.public)


def read_seal(folder: Path) -> RunSeal | None:
    """Read the seal of a run and check its signature.

    Parameters
    ----------
    folder
        Run folder.

    Returns
    -------
    RunSeal or None
        The seal, whose list has still to be compared with the files; None for an unsealed run.

    Raises
    ------
    DataError
        The list or the signature is missing, malformed, or not of the other one.
    DiskError
        The disk does not give them back.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.seal import read_seal
    >>> read_seal(Path("runs/decay")) is None
    True
    """
    paths = (folder / SEAL, folder / SIGNATURE)
    if not any(path.exists() for path in paths):
        return None
    try:
        content = read_bytes(paths[0], MAX_TEXT_BYTES)
        signer = signer_of(content, read_text(paths[1], _MOST_SIGNATURE_BYTES))
        return RunSeal(FileList.parse(content.decode()), signer)
    except (UsageError, DataError, UnicodeDecodeError) as error:
        raise DataError(f"{folder / SEAL}: the seal is broken: {error}") from None
