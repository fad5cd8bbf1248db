"""What is shipped beside labrig, found by place and not by name.

`drivers`, `protocols`, `sim` and `config` are names that a user's own folder or notebook may well
bear. So labrig never asks the import path for them: it takes the ones next to itself and loads
them as `labrig.drivers`, `labrig.protocols` and `labrig.sim`.
"""

import importlib
import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from labrig.errors import UsageError
from labrig.yaml_file import did_you_mean

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("drivers", "protocols", "sim")
#: What names stand for: a YAML file, or measured curves in JSON.
SUFFIXES = (".yaml", ".yml", ".json")


def folder(name: str) -> Path:
    """Path of a shipped folder: `config`, `protocols`, …"""
    return ROOT / name


def find(place: str, kind: str, name_or_path: str | os.PathLike[str]) -> Path:
    """File of a shipped name (`decay`, `sim`, `blue-paint`), or the path as given.

    A bare word is always a shipped name, whatever lies in the current folder; a file of one's own
    has its suffix or a folder before it.

    Parameters
    ----------
    place
        Shipped folder where such names live, such as `config/materials`.
    kind
        What to call it in messages: `material`.

    Raises
    ------
    UsageError
        Neither a shipped name nor a file.
    """
    given = Path(name_or_path)
    if given.suffix in SUFFIXES or len(given.parts) > 1:
        if not given.is_file():
            raise UsageError(f"{given}: no such {kind} file")
        return given
    known = names(place)
    if str(given) not in known:
        raise UsageError(
            f"no shipped {kind} is called '{given}'; {did_you_mean(str(given), list(known))}; a "
            f"file of your own is given with its suffix, such as {given}.yaml"
        )
    return known[str(given)]


def names(place: str) -> dict[str, Path]:
    """Name → file of all that is shipped in a folder, sorted."""
    files = (path for path in (ROOT / place).iterdir() if path.suffix in SUFFIXES)
    return {path.stem: path for path in sorted(files)}


def load(module: str) -> ModuleType:
    """Import a shipped module, such as `drivers.numato`, from beside labrig.

    Parameters
    ----------
    module
        Dotted name; its first part is one of `PACKAGES`.
    """
    package = module.partition(".")[0]
    if package not in PACKAGES:
        raise ModuleNotFoundError(f"{module} is not shipped with labrig", name=module)
    alias = f"labrig.{package}"
    if alias not in sys.modules:
        _load_package(alias, ROOT / package)
    return importlib.import_module(f"labrig.{module}")


def _load_package(alias: str, place: Path) -> None:
    spec = importlib.util.spec_from_file_location(
        alias, place / "__init__.py", submodule_search_locations=[str(place)]
    )
    if spec is None or spec.loader is None:
        raise ModuleNotFoundError(f"no package at {place}", name=alias)
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[alias] = loaded
    try:
        spec.loader.exec_module(loaded)
    except BaseException:
        del sys.modules[alias]
        raise
