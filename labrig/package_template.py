"""New packages for drivers and protocols of a person's own, from shipped templates.

A template is a package that works: its names are replaced, nothing else.
"""

import keyword
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from labrig.foundation import plugins, resources
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.output_file import make_folder, write_text

Kind = Literal["driver", "protocol"]
#: Name of each template's module, and the entry points that must not have the new name yet.
_TEMPLATES = {
    "driver": ("my_relay", plugins.DRIVERS),
    "protocol": ("my_protocol", plugins.MEASUREMENTS),
}
_SUFFIXES = (".py", ".toml", ".yaml")
_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")


def create_package(kind: Kind, name: str, folder: Path) -> None:
    """Write a package with a driver or a protocol, its entry points and a test that passes.

    Parameters
    ----------
    kind
        Template to start from.
    name
        Name of the driver or protocol, and of the package's module.
    folder
        New folder of the package.

    Raises
    ------
    UsageError
        The name is no name of a module or is in use, or the folder exists.
    DiskError
        The folder cannot be written.
    """
    module, group = _TEMPLATES[kind]
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise UsageError(
            f"{name!r} cannot be the name of a {kind}: expected a letter, then small letters, "
            "digits and single underscores, such as 'my_board'"
        )
    if folder.exists():
        raise UsageError(f"{folder} is there already; give the new {kind} another name")
    if name in plugins.names(group) or find_spec(name) is not None:
        raise UsageError(
            f"the name '{name}' is in use by another {kind} or module; give the new {kind} another"
        )
    template = resources.folder(f"config/templates/{kind}")
    for path in sorted(template.rglob("*")):
        if path.suffix in _SUFFIXES:
            place = folder / _renamed(path.relative_to(template).as_posix(), module, name)
            make_folder(place.parent)
            write_text(place, _renamed(read_text(path), module, name))


def _renamed(text: str, module: str, name: str) -> str:
    """Replace a template's names: of the module, of the distribution and of the class."""
    for form in (lambda word: word, lambda word: word.replace("_", "-"), _class_name):
        text = text.replace(form(module), form(name))
    return text


def _class_name(module: str) -> str:
    return "".join(word.capitalize() for word in module.split("_"))
