"""Kinds of files that labrig reads and writes, recognised by their beginning."""

import re
from dataclasses import dataclass
from pathlib import Path

from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import open_regular

#: Bytes of a file that are looked at: all top-level keys of a file that a person writes.
BEGINNING = 100_000


@dataclass(frozen=True)
class FileKind:
    """One kind of file or folder.

    Attributes
    ----------
    name
        Noun with its article, for messages.
    use
        Relative clause that names where such a file goes.
    in_run
        Path of such a file within a run folder; empty if runs have none.
    """

    name: str
    use: str = ""
    in_run: str = ""


RUN = FileKind("a run folder", "which labrig runs show takes")
PROTOCOL = FileKind("a protocol", "which labrig plan and labrig run take", "protocol.yaml")
RIG = FileKind("a rig file", "which goes to --rig", "rig.yaml")
MATERIAL = FileKind("a material", "which labrig material show takes", "result/material.yaml")
SCENE = FileKind("a scene", "which labrig render takes")
WISH = FileKind("a wish for a material", "which labrig design --constraints takes")
QUEUE = FileKind("a queue", "which labrig queue takes by --queue")
TABLE = FileKind("a table", "which labrig fit decay takes if it is of a decay", "result/series.csv")
CURVES = FileKind("a file of curves", "which labrig optics show takes")
PHOTOGRAPH = FileKind("a photograph (RAW)", "which labrig frame takes", "frames")
CALIBRATION = FileKind("a calibration", "which a rig file names under 'optics:'")
RESULT = FileKind("a result", "which labrig.read_result reads from its run", "result/result.json")
REPORT = FileKind("a report (HTML)", "which opens in a browser", "result/report.html")
JOURNAL = FileKind("a journal", "which labrig runs show reads from its run")
PROVENANCE = FileKind("a record of a result", "which labrig runs show reads from its run")
PICTURE = FileKind("a picture", "which opens in an image viewer")
DOCUMENT = FileKind("a PDF", "which opens in a viewer of documents")
NEXUS = FileKind("a NeXus or HDF5 file", "which silx view opens", "result/run.nxs")

#: Kinds by the first bytes of a file; a TIFF is a photograph only by its suffix.
_SIGNATURES = (
    (b"\x89PNG", PICTURE),
    (b"\xff\xd8\xff", PICTURE),
    (b"%PDF", DOCUMENT),
    (b"\x89HDF", NEXUS),
    (b"FUJIFILM", PHOTOGRAPH),
)
_TIFF = (b"II*\0", b"MM\0*", b"IIRO", b"IIU\0")
_RAW_SUFFIXES = {
    ".dng", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".arw", ".orf", ".rw2", ".raf", ".pef",
}  # fmt: skip
_CALIBRATIONS = (
    "blank", "camera", "fade", "irradiance", "leds", "lvf", "reference", "reflectance",
)  # fmt: skip
#: Kinds by the value of the top-level key `kind` of a YAML file.
_BY_KIND = {
    "phosphor": MATERIAL,
    "fluorescent": MATERIAL,
    "scene": SCENE,
    **dict.fromkeys(_CALIBRATIONS, CALIBRATION),
}
#: Kinds by a top-level key of a YAML file that no other kind has.
_BY_KEY = {
    "protocol": PROTOCOL,
    "devices": RIG,
    "runs": QUEUE,
    "libraries": PROVENANCE,
    "keys": WISH,
}
_YAML = {".yaml", ".yml"}
_TABLES = {".csv", ".tsv"}
_TOP_LEVEL = re.compile(r"^([A-Za-z_]+):[ \t]*([^\s#]*)", re.MULTILINE)
_PAGE = re.compile(rb"\s*(<!--.*?-->\s*)*<(!doctype html|html)", re.IGNORECASE | re.DOTALL)


def kind_of(path: Path) -> FileKind | None:
    """Return the kind of a file or folder, None if it is of none that labrig knows.

    Parameters
    ----------
    path
        Path of what exists or not; only the beginning of a file is read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.file_kind import kind_of
    >>> kind_of(Path("runs/decay")).name, kind_of(Path("runs/decay/rig.yaml")).name
    ('a run folder', 'a rig file')
    """
    if path.is_dir():
        return (
            RUN if all((path / name).is_file() for name in (PROTOCOL.in_run, RIG.in_run)) else None
        )
    try:
        with open_regular(path) as file:
            beginning = file.read(BEGINNING)
    except (UsageError, OSError):
        return None  # its reader says so
    for signature, kind in _SIGNATURES:
        if beginning.startswith(signature):
            return kind
    suffix = path.suffix.lower()
    if suffix in _RAW_SUFFIXES and (beginning.startswith(_TIFF) or beginning[4:8] == b"ftyp"):
        return PHOTOGRAPH
    if _PAGE.match(beginning):
        return REPORT
    if path.name == "journal.jsonl":
        return JOURNAL
    if suffix == ".json":
        is_result = all(key in beginning[:200] for key in (b'"kind"', b'"schema_version"'))
        return RESULT if is_result else None
    if suffix in _YAML:
        return _kind_of_yaml(beginning.decode("utf-8", "replace"))
    return TABLE if suffix in _TABLES else None


def _kind_of_yaml(text: str) -> FileKind | None:
    keys = dict(_TOP_LEVEL.findall(text))
    if stated := keys.get("kind", "").strip("'\""):
        return _BY_KIND.get(stated)
    return next((kind for key, kind in _BY_KEY.items() if key in keys), None)


def require_kind(path: Path, *expected: FileKind) -> None:
    """Refuse a file or folder that is recognised as of another kind than those expected.

    Parameters
    ----------
    path
        Path of what exists or not.
    expected
        Kinds that the reader takes, the usual one first.

    Raises
    ------
    UsageError
        It is of another kind; the message names both, and where such a file is or goes.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.file_kind import RIG, require_kind
    >>> require_kind(Path("runs/decay/rig.yaml"), RIG)
    >>> require_kind(Path("runs/decay/protocol.yaml"), RIG)
    Traceback (most recent call last):
    labrig.foundation.errors.UsageError: ...: this is a protocol; a rig file is expected ...
    """
    actual = kind_of(path)
    if actual is None or actual in expected:
        return
    wanted = expected[0]
    raise UsageError(
        f"{path}: this is {actual.name}, {actual.use}; {wanted.name} is expected"
        f"{_whereabouts(path, actual, wanted)}"
    )


def _whereabouts(path: Path, actual: FileKind, wanted: FileKind) -> str:
    """Return where what is wanted is, if a run folder was given or what lies in one; else empty."""
    if actual is RUN and wanted.in_run and (path / wanted.in_run).exists():
        return f", see {path / wanted.in_run}"
    if wanted is RUN and (run := run_around(path)) is not None:
        return f", see {run}"
    return ""


def run_around(path: Path) -> Path | None:
    """Return the run folder in which a file or folder lies; None if it lies in none.

    Parameters
    ----------
    path
        Path of a file or folder.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.foundation.file_kind import run_around
    >>> run_around(Path("runs/decay/result/report.html")).name
    'decay'
    """
    for folder in path.parents:
        if folder.parts and kind_of(folder) is RUN:
            return folder
    return None
