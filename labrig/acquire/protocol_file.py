"""Reading of protocol files, by the model of the protocol that they name."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel

from labrig.acquire.protocol import ProtocolModel
from labrig.foundation.errors import UsageError
from labrig.foundation.file_kind import PROTOCOL, require_kind
from labrig.foundation.named_files import with_absolute_paths
from labrig.foundation.plugins import MEASUREMENTS, measurement, names
from labrig.foundation.yaml_file import read_yaml, validate


def read_protocol(
    path: str | Path, changes: Mapping[str, Any] = MappingProxyType({})
) -> ProtocolModel:
    """Read a protocol file and validate it with the model that its key `protocol` names.

    Paths of files and folders that it names are relative to its own folder, and absolute in the
    result.

    Parameters
    ----------
    path
        Protocol file in YAML.
    changes
        Values of keys instead of those in the file, by dotted keys such as `sample.name`; paths
        among them are relative to the working folder.

    Returns
    -------
    ProtocolModel
        Model of the protocol, frozen.

    Raises
    ------
    UsageError
        If the file cannot be read, or a key is missing, unknown or invalid; the message names both.

    Examples
    --------
    >>> import labrig
    >>> protocol = labrig.read_protocol("runs/decay/protocol.yaml")
    >>> protocol.protocol, protocol.charge, protocol.camera.iso
    ('decay', 600.0, 400)
    >>> [unit.name for unit in protocol.units()]
    ['dark', 'meter', 'decay-1']
    """
    path = Path(path)
    require_kind(path, PROTOCOL)
    return protocol_of(read_yaml(path), path, changes)


def protocol_of(
    content: dict[str, Any], path: Path, changes: Mapping[str, Any] = MappingProxyType({})
) -> ProtocolModel:
    """Return the protocol with the content of the file at `path`, as `read_protocol` does."""
    model = _model(content, str(path))
    content = with_absolute_paths(content, model, path.resolve().parent)
    for key, value in changes_with_absolute_paths(changes, model, Path.cwd()).items():
        _change(content, key, value, str(path))
    return validate(content, _model(content, str(path)), str(path))


def _model(content: Mapping[str, Any], source: str) -> type[ProtocolModel]:
    kind = content.get("protocol")
    if not isinstance(kind, str):
        raise UsageError(
            f"{source}: the key 'protocol' must name one of: {', '.join(names(MEASUREMENTS))}"
        )
    model: type[ProtocolModel] = measurement(kind, source).load("protocol")
    return model


def changes_with_absolute_paths(
    changes: Mapping[str, Any], model: type[BaseModel], folder: Path
) -> dict[str, Any]:
    """Return changes of a protocol with absolute paths where its model has a path.

    Parameters
    ----------
    changes
        Values by dotted keys such as `sample.name`.
    model
        Model of the protocol.
    folder
        Folder to which paths among the values are relative.

    Returns
    -------
    dict of str to object
        The changes with absolute paths.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.acquire import changes_with_absolute_paths
    >>> from labrig.protocols.luminance.protocol import Luminance
    >>> typed = {"emission": "green.csv", "sample.name": "batch.a"}
    >>> changes_with_absolute_paths(typed, Luminance, Path("/lab"))
    {'emission': '/lab/green.csv', 'sample.name': 'batch.a'}
    """
    absolute = {}
    for key, value in changes.items():
        *outer, last = key.split(".")
        content: dict[str, Any] = {last: value}
        for name in reversed(outer):
            content = {name: content}
        content = with_absolute_paths(content, model, folder)
        for name in outer:
            content = content[name]
        absolute[key] = content[last]
    return absolute


def _change(content: dict[str, Any], key: str, value: Any, source: str) -> None:
    """Set a dotted key in the content of a file."""
    *outer, last = key.split(".")
    for name in outer:
        content = content.setdefault(name, {})
        if not isinstance(content, dict):
            raise UsageError(f"{source}: expected keys below '{name}' to change '{key}', got none")
    content[last] = value
