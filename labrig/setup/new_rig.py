"""A new rig file: devices that were discovered, keys that a person gave, what was measured."""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from textwrap import wrap
from typing import Any

from pydantic import BaseModel

from labrig.acquire import CAMERA, ROLES, DeviceEntry, RigFile, driver_and_settings, load_driver
from labrig.foundation.errors import UsageError
from labrig.foundation.key_texts import descriptions
from labrig.foundation.yaml_file import parse_yaml, validate, yaml_text
from labrig.setup.check import DeviceReport, RigReport
from labrig.setup.discover import USUAL_SHUTTER_LAG, Discovery

#: Width of the text, and column at which comments begin at the earliest.
WIDTH, COMMENT = 100, 30
#: Keys of a device that are asked for although its driver has a default, and usual values, by role.
USUAL = {
    "lamp": {"warm_up": "15 min"},
    "camera": {"warm_up": "30 min", "shutter_lag": USUAL_SHUTTER_LAG},
}
#: End of the first statement of a description; the value of the file is an example itself.
_FIRST = re.compile(r"\. |, for example|: the protocol")
_CURVES = """\
# Curves that calibrations and excitation rates need: names of shipped files, or paths of yours.
# optics:
#   camera: ./my-camera.csv       # default: that of the camera's model, if it is shipped
#   lamp: ./my-lamp.csv
#   grey_card: ./my-card.csv
#   filters: ./my-filters         # a folder with a table for each colour filter
#   luminance: {value: 312 lx, sigma: 3 %, at: sample plane, lamp: halogen}
"""


@dataclass(frozen=True)
class Candidate:
    """A device that may become one of the rig.

    Attributes
    ----------
    role
        Key of the device in a rig file.
    name
        Name for a person.
    keys
        Its keys in a rig file, `driver` and `address` among them.
    hints
        Obstacles to its use, with remedies.
    """

    role: str
    name: str
    keys: Mapping[str, Any]
    hints: tuple[str, ...] = ()


def candidates(discovery: Discovery) -> list[Candidate]:
    """Return the connected devices that a rig file may have.

    Parameters
    ----------
    discovery
        Devices of this PC.

    Returns
    -------
    list of Candidate
        Those with a line for a rig file.

    Examples
    --------
    >>> from labrig.setup import Discovery, FoundDevice, candidates
    >>> snippet = 'lamp: {driver: numato, address: "COM3", relay: 0, warm_up: 15 min}'
    >>> board = FoundDevice("COM3", "Numato relay board", snippet)
    >>> candidates(Discovery((board,), ()))[0].keys["relay"]
    0
    """
    connected = (*discovery.ports, *discovery.cameras, *discovery.spectrometers)
    return [
        Candidate(role, f"{device.name} at {device.address}", keys, device.hints)
        for device in connected
        if device.snippet
        for role, keys in parse_yaml(device.snippet, device.address).items()
    ]


def simulated_candidates(room: Mapping[str, Any]) -> list[Candidate]:
    """Return the devices of a simulated room, with the keys that a rig file has for them.

    Parameters
    ----------
    room
        Content of the room's rig file as it was written.

    Returns
    -------
    list of Candidate
        All devices of the file.

    Examples
    --------
    >>> from labrig.setup import simulated_candidates
    >>> lamp = {"driver": "numato", "address": "sim://room/relays", "relay": 0}
    >>> simulated_candidates({"devices": {"lamp": lamp}})[0].name
    'simulated lamp at sim://room/relays'
    """
    return [
        Candidate(key, f"simulated {ROLES[key].name} at {keys['address']}", keys)
        for key, keys in room["devices"].items()
    ]


@dataclass(frozen=True)
class NewRig:
    """Content of a rig file to be.

    Attributes
    ----------
    name
        Name of the bench.
    devices
        Keys of each device, by its key in the rig file.
    names
        Names of devices for comments, by the same keys.
    measured
        Lines about what was measured of each device, for comments, by the same keys.
    others
        Devices that were found and are not used.
    simulated
        Content of the rig file of the simulated room whose devices they are; None on a real bench.
    """

    name: str
    devices: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    names: Mapping[str, str] = field(default_factory=dict)
    measured: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    others: tuple[Candidate, ...] = ()
    simulated: Mapping[str, Any] | None = None

    def with_device(self, role: str, keys: Mapping[str, Any], name: str = "") -> "NewRig":
        """Return the rig with a device, in place of what it had in that role."""
        return replace(
            self,
            devices={**self.devices, role: dict(keys)},
            names={**self.names, **({role: name} if name else {})},
        )

    def file(self, source: str) -> RigFile:
        """Return the content as a rig file.

        Parameters
        ----------
        source
            Path of the file, for messages.

        Raises
        ------
        UsageError
            There is no device, no such role or driver, or a key is missing or invalid.
        """
        return validate(self._content(), RigFile, source)

    def model(self, role: str, source: str) -> type[BaseModel]:
        """Return the model of the keys that belong to a device's driver.

        Raises
        ------
        UsageError
            There is no such driver for that role.
        """
        driver = load_driver(role, str(self.devices[role].get("driver", "")), source)
        settings: type[BaseModel] = driver.Settings
        return settings

    def asked_keys(self, role: str, source: str) -> dict[str, str]:
        """Return the keys of a device that a person is asked for, each with its description.

        They are those that are given as a plain value, and those without a default.
        """
        model, given = self.model(role, source), self.devices[role]
        required = [name for name, each in model.model_fields.items() if each.is_required()]
        plain = [
            key
            for key, value in given.items()
            if key not in ("driver", "address") and not isinstance(value, dict | list)
        ]
        texts = _texts(model)
        return {
            key: texts.get(key, "")
            for key in dict.fromkeys((*plain, *required, *USUAL.get(role, ())))
            if key in texts and not isinstance(given.get(key), dict | list)
        }

    def refusal(self, role: str, source: str) -> str:
        """Return why the keys of a device are invalid; empty if they are valid."""
        try:
            driver_and_settings(self.file(source), role, source)
        except UsageError as error:
            return str(error)
        return ""

    def with_report(self, report: RigReport) -> "NewRig":
        """Return the rig with what a check measured: keys that it suggests, times in comments."""
        rig = self
        for device in report.devices:
            suggested = {
                each.key: parse_yaml(f"value: {each.value}", each.key)["value"]
                for each in device.suggestions
            }
            keys = {**rig.devices[device.key], **suggested}
            if rig.simulated is not None:  # the room says these itself
                keys = {k: v for k, v in keys.items() if k not in ("frame_pixels", "frame_size")}
            rig = rig.with_device(device.key, keys)
            lines = tuple(_measured_lines(device))
            rig = replace(rig, measured={**rig.measured, device.key: lines})
        return rig

    def text(self) -> str:
        """Return the commented text of the rig file."""
        parts = [
            "# Rig file, made by 'labrig rig new'; all keys: docs/reference/rig_keys.md.\n"
            "# After a change: labrig rig check FILE.\n",
            f"{_one_line('name', self.name)}\n\ndevices:\n",
            *(line for role in self.devices for line in self._device_lines(role)),
            *self._other_lines(),
            "\n",
        ]
        if self.simulated is None:
            return "".join((*parts, _CURVES))
        for section, content in self._room().items():
            parts += [f"{section}:\n", *(f"  {_one_line(*each)}\n" for each in content.items())]
        return "".join(parts)

    def unmeasured(self) -> tuple[str, ...]:
        """Return what no check can measure, with what does."""
        lag = self.devices.get(CAMERA.key, {}).get("shutter_lag")
        if lag is None:
            return ()
        return (
            f"not measured: shutter_lag ({lag}), which no camera reports; the protocol fade finds "
            "it by light",
        )

    def _content(self) -> dict[str, Any]:
        content: dict[str, Any] = {"name": self.name, "devices": dict(self.devices)}
        return content | self._room()

    def _room(self) -> dict[str, Any]:
        room = self.simulated or {}
        return {key: room[key] for key in ("optics", "simulation") if key in room}

    def _device_lines(self, role: str) -> Iterator[str]:
        name = self.names.get(role, "")
        yield _commented(f"  {role}:", name)
        texts = _texts(self.model(role, self.name))
        for key, value in self.devices[role].items():
            comment = "" if key in ("driver", "address") else texts.get(key, "")
            if isinstance(value, dict) and len(_flow(value)) > WIDTH // 2:
                yield _commented(f"    {key}:", comment)
                yield from (f"      {_one_line(*each)}\n" for each in value.items())
            else:
                yield _commented(f"    {_one_line(key, value)}", comment)
        yield from (f"    # {line}\n" for line in self.measured.get(role, ()))
        yield from (f"    # {line}\n" for line in self.unmeasured() if role == CAMERA.key)

    def _other_lines(self) -> Iterator[str]:
        for other in self.others:
            yield f"  # {other.name}\n"
            lines = yaml_text({other.role: dict(other.keys)}).splitlines()
            yield from (f"  # {line}\n" for line in lines)


def _texts(model: type[BaseModel]) -> dict[str, str]:
    """Return the first sentence on each key that a device may have."""
    whole = descriptions(DeviceEntry) | descriptions(model)
    whole |= {
        name: each.description for name, each in model.model_fields.items() if each.description
    }
    keys: Collection[str] = (*DeviceEntry.model_fields, *model.model_fields)
    first = {key: _FIRST.split(text)[0].removesuffix(".") for key, text in whole.items()}
    return {key: text.replace("`", "") for key, text in first.items() if key in keys}


def _one_line(key: str, value: Any) -> str:
    """Return a key with its value as YAML in one line."""
    return f"{key}: {_flow(value)}"


def _flow(value: Any) -> str:
    """Return a value as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_flow(key)}: {_flow(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(_flow, value))}]"
    text = yaml_text({"k": value}).removeprefix("k: ").rstrip("\n")
    needs_quotes = text[:1] not in "'\"" and isinstance(value, str) and set(text) & set(",[]{}")
    return f'"{text}"' if needs_quotes else text


def _commented(line: str, comment: str) -> str:
    """Return a line with a comment behind it, or in lines before it if both do not fit."""
    if not comment:
        return f"{line}\n"
    whole = f"{line:<{COMMENT}}  # {comment}"
    if len(whole) <= WIDTH:
        return f"{whole}\n"
    indent = line[: len(line) - len(line.lstrip())] + "# "
    before = wrap(comment, WIDTH, initial_indent=indent, subsequent_indent=indent)
    return "\n".join((*before, line, ""))


def _measured_lines(device: DeviceReport) -> Iterator[str]:
    yield device.identity
    for each in device.measured:
        line = f"measured: {each.what}: {each.value}"
        if len(line) < WIDTH - len("    # "):  # neither what is a key, nor noise by channel
            yield line
    for finding in device.findings:
        if finding.severity != "fine":
            yield f"{finding.severity}: {finding}"
