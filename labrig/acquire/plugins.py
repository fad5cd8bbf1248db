"""Drivers and protocols by name: the shipped ones and those that other packages add.

A package adds its own by an entry point in `labrig.drivers` or `labrig.protocols`; how a protocol's
runs are processed is registered under the same name in `labrig.processing`.
"""

from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from labrig.acquire.protocol import ProtocolModel
from labrig.acquire.roles import ROLES
from labrig.errors import UsageError
from labrig.yaml_file import did_you_mean, read_yaml, validate

DRIVERS = "labrig.drivers"
PROTOCOLS = "labrig.protocols"
PROCESSING = "labrig.processing"
_KINDS = {DRIVERS: "driver", PROTOCOLS: "protocol", PROCESSING: "processing of protocol"}


def names(group: str) -> list[str]:
    """Names that can be used, sorted."""
    return sorted({entry.name for entry in entry_points(group=group)})


def load(group: str, name: str, source: str) -> Any:
    """The class or function registered as `name`; `source` says in messages who asked for it.

    Raises
    ------
    UsageError
        There is none, or it cannot be imported.
    """
    found = {entry.name: entry for entry in entry_points(group=group)}
    kind = _KINDS[group]
    if name not in found:
        raise UsageError(f"{source}: unknown {kind} '{name}'; {did_you_mean(name, list(found))}")
    try:
        return found[name].load()
    except (ImportError, AttributeError) as error:
        raise UsageError(
            f"{source}: the {kind} '{name}' ({found[name].value}) cannot be imported ({error})"
        ) from None


def load_driver(key: str, name: str, source: str) -> Any:
    """The driver registered as `name`, for the device `key` of the rig file `source`.

    Raises
    ------
    UsageError
        As of `load`; or it is the driver of a device of another kind.
    """
    driver = load(DRIVERS, name, source)
    if not issubclass(driver, ROLES[key]):
        raise UsageError(
            f"{source}: the driver '{name}' is no {key}; choose another driver for 'devices.{key}'"
        )
    return driver


def read_protocol(path: Path) -> ProtocolModel:
    """Read and check a protocol file by the model that its key `protocol` names.

    Raises
    ------
    UsageError
        One line that names the file and the key.
    """
    content = read_yaml(path)
    kind = content.get("protocol")
    if not isinstance(kind, str):
        raise UsageError(
            f"{path}: the key 'protocol' must name one of: {', '.join(names(PROTOCOLS))}"
        )
    model: type[ProtocolModel] = load(PROTOCOLS, kind, str(path))
    return validate(content, model, str(path))
