"""Protocol and rig of a run: as its journal has them, or as its files were edited since."""

from pathlib import Path

from labrig.acquire.protocol import ProtocolModel
from labrig.acquire.protocol_file import protocol_of, read_protocol
from labrig.acquire.rig_file import RigFile, read_rig_file, rig_of
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml
from labrig.record import journal_text

PROTOCOL, RIG = "protocol.yaml", "rig.yaml"


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
