"""What is shipped beside labrig, found by place and not by name.

`drivers`, `protocols`, `sim` and `config` are names that a user's own folder or notebook may well
bear. So labrig never asks the import path for them: it takes the ones next to itself and loads
them as `labrig.drivers`, `labrig.protocols` and `labrig.sim`.
"""

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("drivers", "protocols", "sim")


def folder(name: str) -> Path:
    """Path of a shipped folder: `config`, `protocols`, …"""
    return ROOT / name


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
