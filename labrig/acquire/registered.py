"""Drivers as devices of a kind, and protocol files by the model that they name."""

from pathlib import Path
from typing import Any

from labrig.acquire.protocol import ProtocolModel
from labrig.acquire.roles import ROLES
from labrig.errors import UsageError
from labrig.plugins import DRIVERS, PROTOCOLS, load, names
from labrig.yaml_file import read_yaml, validate


def load_driver(key: str, name: str, source: str) -> Any:
    """The driver registered as `name`, for the device `key` of the rig file `source`.

    Raises
    ------
    UsageError
        As of `load`; or it is the driver of a device of another kind.
    """
    driver, role = load(DRIVERS, name, source), ROLES[key]
    if not issubclass(driver, role.does):
        raise UsageError(
            f"{source}: the driver '{name}' is no {role.name}; choose another driver for "
            f"'devices.{key}'"
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
