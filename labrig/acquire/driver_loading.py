"""Loading of registered drivers by name, and checks of what their settings claim."""

from collections.abc import Hashable, Mapping
from typing import Any

from labrig.acquire.channels import Board
from labrig.acquire.rig_file import RigFile
from labrig.acquire.roles import ROLES
from labrig.acquire.roles.board_device import BoardDevice
from labrig.foundation.errors import UsageError
from labrig.foundation.plugins import DRIVERS, load
from labrig.foundation.yaml_file import validate


def load_driver(key: str, name: str, source: str) -> Any:
    """Load the driver class of a device.

    Parameters
    ----------
    key
        Key of the device in the rig file, such as `lamp`.
    name
        Name under which the driver is registered, such as `numato`.
    source
        Name or path of the rig file, for messages.

    Returns
    -------
    type
        Class that satisfies the Protocol of the role `key`: the driver itself, or the role on
        channels of the driver's board.

    Raises
    ------
    UsageError
        If there is no such driver, if it cannot be imported, or if it is one for another role.

    Examples
    --------
    >>> from labrig.acquire import load_driver
    >>> load_driver("lamp", "numato", "rig.yaml").__name__
    'NumatoSwitchedLamp'
    """
    role = ROLES[key]
    driver = role.driver(load(DRIVERS, name, source))
    if driver is None:
        raise UsageError(
            f"{source}: the driver '{name}' is no {role.name}; choose another driver for "
            f"'devices.{key}'"
        )
    return driver


def driver_and_settings(rig: RigFile, key: str, source: str) -> tuple[Any, Any]:
    """Load the driver class of a device of a rig file, and validate its keys.

    Parameters
    ----------
    rig
        Rig file with the device.
    key
        Key of the device in the rig file, such as `lamp`.
    source
        Name or path of the rig file, for messages.

    Returns
    -------
    driver : type
        Class of the driver; it satisfies the Protocol of the role `key`.
    settings : BaseModel
        The device's keys, of the driver's class `Settings`.

    Raises
    ------
    UsageError
        If there is no such driver, if it is one for another role, or if a key is unknown or
        invalid.

    Examples
    --------
    >>> import labrig
    >>> from labrig.foundation import resources
    >>> from labrig.acquire import driver_and_settings
    >>> rig = labrig.read_rig_file(resources.find("config", "rig", "sim-arduino"))
    >>> driver, settings = driver_and_settings(rig, "leds", "sim-arduino")
    >>> driver.__name__, list(settings.channels)
    ('SerialRelaySwitchedLeds', ['450 nm', '525 nm'])
    """
    entry = rig.devices[key]
    driver = load_driver(key, entry.driver, source)
    return driver, validate(entry.settings(), driver.Settings, f"{source}, devices.{key}")


def require_own_ports(rig: RigFile, source: str) -> None:
    """Refuse two kinds of boards at one address, and two devices on one channel of a board.

    Parameters
    ----------
    rig
        Rig file with the devices.
    source
        Name or path of the rig file, for messages.

    Raises
    ------
    UsageError
        Two devices contradict each other, or there is no such driver, or a key is invalid.

    Examples
    --------
    >>> import labrig
    >>> from labrig.acquire import require_own_ports
    >>> require_own_ports(labrig.read_rig_file("runs/decay/rig.yaml"), "rig.yaml")
    """
    devices = {key: driver_and_settings(rig, key, source) for key in rig.devices}
    refuse_shared_outlets(rig, devices, source)


def refuse_shared_outlets(
    rig: RigFile, devices: Mapping[str, tuple[Any, Any]], source: str
) -> None:
    """Refuse what `require_own_ports` refuses, of devices whose driver and settings are loaded."""
    at: dict[str, str] = {}
    occupied: dict[tuple[str, Hashable], str] = {}
    for key, entry in rig.devices.items():
        for address in entry.addresses():
            other = at.setdefault(address.casefold(), key)
            drivers = (rig.devices[other].driver, entry.driver)
            if drivers[0] != drivers[1] and any(map(_knows_one_board, drivers)):
                raise UsageError(
                    f"{source}: 'devices.{other}' and 'devices.{key}' are both at {address}, one "
                    f"with the driver {drivers[0]}, the other with {drivers[1]}; a port leads to "
                    "one board: correct an address or a driver ('labrig rig devices' shows the "
                    "ports)"
                )
        driver, settings = devices[key]
        if not issubclass(driver, BoardDevice):
            continue
        for address, outlet in driver.outlets(entry.address, settings):
            other = occupied.setdefault((address.casefold(), outlet), key)
            if other != key and outlet is not None:
                raise UsageError(
                    f"{source}: 'devices.{other}' and 'devices.{key}' are on the same "
                    f"channel of the board at {address}; give each "
                    "its own"
                )


def _knows_one_board(driver: str) -> bool:
    registered = load(DRIVERS, driver, "")
    return issubclass(registered, Board) and not registered.has_own_commands


def bank_lights(rig: RigFile, key: str, source: str) -> dict[str, Any]:
    """Return what a rig file says of the light of a bank, without opening any device.

    Parameters
    ----------
    rig
        Rig file with the devices.
    key
        Key of the bank in the rig file: `leds` or `illuminants`.
    source
        Name or path of the rig file, for messages.

    Returns
    -------
    dict of str to LedLight or Illuminant
        Spectrum and settling time of each light by its name, in the rig file's order, with the
        filter of a lamp; empty if the rig has no such bank.

    Raises
    ------
    UsageError
        If there is no such driver, or a key of the lights is unknown or invalid.

    Examples
    --------
    >>> import labrig
    >>> from labrig.foundation import resources
    >>> from labrig.acquire import bank_lights
    >>> path = resources.find("config", "rig", "sim-arduino")
    >>> lights = bank_lights(labrig.read_rig_file(path), "leds", "sim-arduino")
    >>> [(name, light.peak_nm()) for name, light in lights.items()]
    [('450 nm', 450.0), ('525 nm', 525.0)]
    """
    if key not in rig.devices:
        return {}
    _, settings = driver_and_settings(rig, key, source)
    return dict(settings.channels)
