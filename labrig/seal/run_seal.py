"""The seal of a run: the list of its files with their SHA-256, and the signature of that list."""

import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import file_digest
from importlib.metadata import version
from pathlib import Path

from labrig.foundation.errors import DataError, DiskError, UsageError
from labrig.foundation.input_file import MAX_TEXT_BYTES, open_regular, read_bytes, read_text
from labrig.foundation.output_file import write_text
from labrig.seal.lab_key import LabKey
from labrig.seal.signature import PublicKey, signature_text, signer_of

#: Files and folders of a run that a seal covers: what was asked, what happened, and the result.
#: Earlier results, comparisons and the cache can be made again from these.
_FILES = (
    "protocol.yaml",
    "rig.yaml",
    "calibrations.yaml",
    "made.txt",
    "journal.jsonl",
    "log.txt",
    "notes.md",
)
_FOLDERS = ("frames", "result")
#: What `labrig figures` draws from a result at any time.
_DRAWN_LATER = ("result/figures/figures.pdf",)
_TITLE = "# labrig seal"
_LINE = re.compile(r"([0-9a-f]{64})  (\S[^\r\n\\]*)")
_HEAD = re.compile(r"# (sealed|by|run|journal|labrig): (.*)")


@dataclass(frozen=True)
class FileList:
    """Files of a run with their checksums, and who made the list when.

    Attributes
    ----------
    sha256
        Checksum of each file by its path in the run folder, with `/` between folders.
    journal
        Seal of the journal: SHA-256 of its last line.
    run
        Name of the run folder when it was sealed.
    by
        Name of the laboratory by itself.
    sealed
        Time of the seal in UTC, as text.
    labrig
        Version of labrig.
    """

    sha256: Mapping[str, str]
    journal: str
    run: str
    by: str
    sealed: str
    labrig: str

    def text(self) -> str:
        """Return the list as text, which `sha256sum --check` reads, too."""
        heads = [f"# {key}: {getattr(self, key)}" for key in ("run", "journal", "sealed", "by")]
        lines = [f"{digest}  {name}" for name, digest in sorted(self.sha256.items())]
        return "\n".join([_TITLE, *heads, f"# labrig: {self.labrig}", *lines, ""])

    @classmethod
    def parse(cls, text: str) -> "FileList":
        """Return the list in a text.

        Raises
        ------
        DataError
            It is no such list.
        """
        title, *lines = text.split("\n")
        heads: dict[str, str] = {}
        sha256: dict[str, str] = {}
        for line in lines[:-1]:
            # Names from elsewhere are printed, and are to control no terminal.
            if not line.isprintable():
                raise DataError(f"expected a list of files in legible text, got {line[:60]!r}")
            if head := _HEAD.fullmatch(line):
                heads[head[1]] = head[2]
            elif (entry := _LINE.fullmatch(line)) and entry[2] not in sha256:
                sha256[entry[2]] = entry[1]
            else:
                raise DataError(
                    f"expected a list of files with SHA-256, got the line {line[:60]!r}"
                )
        wanted = {"run", "journal", "sealed", "by", "labrig"}
        if title != _TITLE or heads.keys() != wanted or lines[-1:] != [""]:
            raise DataError(
                f"expected a list of files that begins with '{_TITLE}', got another text"
            )
        return cls(sha256=sha256, **heads)


def list_files(folder: Path, names: Collection[str] = ()) -> dict[str, str]:
    """Return the SHA-256 of every file of a run that a seal covers.

    Parameters
    ----------
    folder
        Run folder.
    names
        Files of the run folder that alone are read, as far as they are there; by default all.

    Returns
    -------
    dict of str to str
        Checksum by the path in the run folder. Files that labrig writes for the moment, and those
        that can be made again, are left out: locks, `cache/`, earlier results, `comparison/`.

    Raises
    ------
    DataError
        A file's name cannot be written in a list.
    DiskError, UsageError
        A file cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.seal import list_files
    >>> names = list_files(Path("runs/decay"))
    >>> "journal.jsonl" in names, "frames/000001.dng" in names
    (True, True)
    """
    sha256_of = {}
    paths = [folder / name for name in names if (folder / name).is_file()]
    for path in paths if names else _files(folder):
        name = path.relative_to(folder).as_posix()
        if name in _DRAWN_LATER:
            continue
        if not _LINE.fullmatch(f"{'0' * 64}  {name}"):
            raise DataError(f"{folder}: expected names of files in one line, got {name!r}")
        try:
            with open_regular(path) as file:
                sha256_of[name] = file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise DiskError(f"{path}: cannot be read ({error.strerror})") from None
    return sha256_of


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files that a seal covers, without following a link."""
    for name in _FILES:
        if (folder / name).exists():
            yield folder / name
    for name in _FOLDERS:
        for parent, _, files in os.walk(folder / name):
            yield from (Path(parent, file) for file in files)


#: Files of the list and of its signature in a run folder.
SEAL = "seal.sha256"
SIGNATURE = f"{SEAL}.sig"
_MAX_SIGNATURE_BYTES = 10_000


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
        signer = signer_of(content, read_text(paths[1], _MAX_SIGNATURE_BYTES))
        return RunSeal(FileList.parse(content.decode()), signer)
    except (UsageError, DataError, UnicodeDecodeError) as error:
        raise DataError(f"{folder / SEAL}: the seal is broken: {error}") from None
