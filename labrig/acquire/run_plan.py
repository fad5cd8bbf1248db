"""Protocol and rig of a run: as its journal has them, or as its files were edited since."""

from pathlib import Path

from labrig.acquire.protocol import ProtocolModel
from labrig.acquire.protocol_file import protocol_of, read_protocol
from labrig.acquire.rig_file import RigFile, read_rig_file, rig_of
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml, read_yaml
from labrig.record import journal_text

PROTOCOL, RIG = "protocol.yaml", "rig.yaml"
#: Option of commands by which edits of a run's files are taken.
EDITED = "--edited"


def read_run_protocol(run: Path, *, edited: bool = False) -> ProtocolModel:
    """Read the protocol of a run.

    Parameters
    ----------
    run
        A run folder.
    edited
        Whether the file in the folder is taken as it is now; else what the journal has of it.

    Returns
    -------
    ProtocolModel
        The protocol as it was when the run was recorded.

    Raises
    ------
    UsageError
        The folder has no protocol.yaml, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import read_run_protocol
    >>> protocol = read_run_protocol(Path("runs/decay"))
    >>> protocol.protocol, protocol.sample.name, list(protocol.patches)
    ('decay', 'sample', ['sample'])
    """
    path = run / PROTOCOL
    if not path.is_file():
        raise UsageError(f"{run}: expected a run folder with {PROTOCOL} in it; see --runs")
    if edited or (text := journal_text(run, PROTOCOL)) is None:
        return read_protocol(path)
    return protocol_of(parse_yaml(text, str(path)), path)


def read_run_rig(run: Path, *, edited: bool = False) -> RigFile:
    """Read the rig of a run.

    Parameters
    ----------
    run
        A run folder.
    edited
        Whether the file in the folder is taken as it is now; else what the journal has of it.

    Returns
    -------
    RigFile
        The rig as it was when the run was recorded.

    Raises
    ------
    UsageError
        There is no rig file, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import read_run_rig
    >>> read_run_rig(Path("runs/decay")).name
    'simulated dark room with LVF'
    """
    path = run / RIG
    if edited or (text := journal_text(run, RIG)) is None:
        return read_rig_file(path)
    return rig_of(parse_yaml(text, str(path)), path)


def result_takes_edits(run: Path) -> bool:
    """Return whether the result of a run was made by its files as they were edited.

    Parameters
    ----------
    run
        A run folder, with a result or without.

    Returns
    -------
    bool
        True if the result's provenance says so.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import result_takes_edits
    >>> result_takes_edits(Path("runs/decay"))
    False
    """
    path = run / "result" / "provenance.yaml"
    try:
        given = read_yaml(path).get("given") if path.is_file() else None
    except UsageError:
        return False
    return isinstance(given, list) and EDITED in given


def read_result_rig(run: Path) -> RigFile:
    """Read the rig by which the result of a run was made.

    Parameters
    ----------
    run
        A run folder.

    Returns
    -------
    RigFile
        The rig as the journal has it, or as its file was edited where the result takes edits.

    Raises
    ------
    UsageError
        There is no rig file, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import read_result_rig
    >>> read_result_rig(Path("runs/decay")).name
    'simulated dark room with LVF'
    """
    return read_run_rig(run, edited=result_takes_edits(run))
