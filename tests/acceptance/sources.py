"""Sources that a campaign uses, and a digest of them: has its code changed since it ran?"""

import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import grimp

ROOT = Path(__file__).parents[2]
#: Folders of the product, each a part of the package labrig.
_PRODUCT = ("labrig", "drivers", "protocols", "sim", "config")
#: Whoever loads by name or starts labrig in a process of its own may reach all of the product.
_REACHES_ALL = ("labrig.foundation.plugins", "tests.acceptance.labrig_process")
_DIGITS = 12


@cache
def digest(module: str) -> str:
    """Return a digest of the sources that a module uses, itself among them.

    A module that is not in the repository, such as pytest, uses all of the product.
    """
    total = hashlib.sha256()
    for path in sorted(_sources(module)):
        total.update(path.relative_to(ROOT).as_posix().encode())
        total.update(_content_digest(path))
    return total.hexdigest()[:_DIGITS]


def _sources(module: str) -> set[Path]:
    graph = _graph()
    if module not in graph.modules:
        return set(_product())
    used = {module}
    waiting = [module]
    while waiting:
        # A package's face may load any of its modules when it is asked for a name.
        one = waiting.pop()
        near = graph.find_modules_directly_imported_by(one)
        if one.startswith("labrig."):
            near |= graph.find_children(one)
        waiting += near - used
        used |= near
    own = {path for one in used if (path := _file(one)) is not None}
    return own | set(_product()) if used.intersection(_REACHES_ALL) else own


@cache
def _graph() -> grimp.ImportGraph:
    return grimp.build_graph("labrig", "tests", cache_dir=None)


@cache
def _product() -> tuple[Path, ...]:
    return tuple(path for folder in _PRODUCT for path in _files_below(ROOT / folder))


def _files_below(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink() and path.name != "__pycache__":
            yield from _files_below(path)
        elif path.is_file():
            yield path


def _file(module: str) -> Path | None:
    """Return the file of a module of the repository; drivers, sim … lie beside labrig."""
    parts = module.split(".")
    if parts[0] == "labrig" and len(parts) > 1 and (ROOT / parts[1]).is_dir():
        parts = parts[1:]
    below = ROOT.joinpath(*parts)
    candidates = (below.with_suffix(".py"), below / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


@cache
def _content_digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()
