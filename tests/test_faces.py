"""Packages are used through their faces: what their `__init__` exports."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

HOME, TESTS = Path(__file__).parents[1], Path(__file__).parent
BESIDE = ("drivers", "protocols", "sim")
#: Their modules are faces: a protocol's model, units and frame roles; one matter of shared ground.
OPEN = ("labrig.foundation", "labrig.protocols")
#: Single modules that are faces: each is a part of its package in one file.
FACES = {
    "labrig.fit.angular",
    "labrig.fit.bispectral",
    "labrig.fit.camera_curves",
    "labrig.text_table.names",
    "labrig.text_table.rows",
}
#: What measurements share: their folders take it from the module that has it.
SHARED = ("labrig.analyse", "labrig.results", "labrig.report")
#: What a source that imports from deep within has somewhere; most have not, and are not parsed.
DEEP = re.compile(r"labrig\.\w+\.\w")


def modules() -> Iterator[Path]:
    """Paths of the product's modules from the repository's root."""
    for folder in ("labrig", *BESIDE):
        for path in (HOME / folder).rglob("*.py"):
            inside = path.relative_to(HOME)
            # Installed for editing, the folders beside are links in labrig.
            if inside.parts[:2] not in [("labrig", linked) for linked in (*BESIDE, "config")]:
                yield inside


def dotted(path: Path) -> str:
    whole = path if path.parts[0] == "labrig" else Path("labrig", path)
    return ".".join(whole.with_suffix("").parts).removesuffix(".__init__")


def past_faces(source: str, importer: str, packages: set[str]) -> Iterator[str]:
    """Imports in `source` of what lies deeper in another package than its face."""
    if DEEP.search(source) is None:
        return
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module or ""]
        elif isinstance(node, ast.Import):
            names = [name.name for name in node.names]
        else:
            continue
        for name in names:
            parts = name.split(".")
            package = ".".join(parts[:2])
            own = ".".join(importer.split(".")[:2])
            open_to_it = (*OPEN, own, *(SHARED if own == "labrig.protocols" else ()))
            is_other = len(parts) > 2 and package not in open_to_it
            if is_other and parts[0] == "labrig" and name not in packages:
                yield f"{importer} imports {name}; import from {name.rpartition('.')[0]}"


def test_no_import_goes_past_a_face() -> None:
    paths = list(modules())
    packages = {dotted(path) for path in paths if path.name == "__init__.py"} | FACES
    assert {"labrig.reduce", "labrig.fit.decay", "labrig.sim.camera"} <= packages
    found = [
        line
        for path in paths
        for line in past_faces((HOME / path).read_text(encoding="utf-8"), dotted(path), packages)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("line", "is_past"),
    [
        ("from labrig.reduce.raw import read_raw", True),
        ("import labrig.reduce.raw", True),
        ("from labrig.reduce import read_raw", False),
        ("from labrig.fit.decay import fit_decay", False),
        ("from labrig.material.file import Material", True),
        ("from labrig.report.page import Report", False),
        ("from labrig.protocols.decay.protocol import Decay", False),
    ],
)
def test_an_import_past_a_face_is_seen(line: str, is_past: bool) -> None:
    packages = {"labrig.reduce", "labrig.fit.decay", "labrig.report"}
    assert bool(list(past_faces(line, "labrig.protocols.decay.report", packages))) == is_past


def test_a_test_imports_no_other_test() -> None:
    """Code that several tests need is in a module of its own."""
    found = [
        f"{path.relative_to(TESTS)}: {line}"
        for path in sorted(TESTS.rglob("*.py"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.match(r"from (tests|\.)[\w.]*\btest_\w+ import ", line)
    ]
    assert not found, "\n".join(found)
