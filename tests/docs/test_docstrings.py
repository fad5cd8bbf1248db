"""Exported functions say all about themselves, by numpydoc's rules, and their examples run."""

import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from numpydoc.validate import validate

import labrig

#: Types stand in the signatures; a summary may be all there is to say, and neighbours stand beside.
NOT_ASKED = {"PR04", "ES01", "SA01"}
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def faces() -> Iterator[str]:
    """labrig itself and its packages that export something."""
    yield "labrig"
    for module in pkgutil.iter_modules(labrig.__path__, "labrig."):
        if module.ispkg and hasattr(importlib.import_module(module.name), "__all__"):
            yield module.name


def exported() -> dict[str, Any]:
    """Every exported function and class by the name of its shortest export."""
    names: dict[Any, str] = {}
    for face in faces():
        module = importlib.import_module(face)
        for name in module.__all__:
            member = getattr(module, name)
            if inspect.isfunction(member) or inspect.isclass(member):
                names.setdefault(member, f"{face}.{name}")
    return {name: member for member, name in names.items()}


EXPORTED = exported()
FUNCTIONS = [name for name, member in EXPORTED.items() if inspect.isfunction(member)]
#: A class may be described without an example; tests of results run those of results.
CLASSES_WITH_EXAMPLE = [
    name
    for name, member in EXPORTED.items()
    if inspect.isclass(member)
    and ">>>" in (member.__doc__ or "")
    and not member.__module__.startswith(("labrig.results", "labrig.protocols"))
]


def test_all_packages_are_looked_through() -> None:
    assert {"labrig.fit_decay", "labrig.optics.read_spectrum"} <= set(FUNCTIONS)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_parameters_returns_and_example_are_there(name: str) -> None:
    errors = [f"{code} {text}" for code, text in validate(name)["errors"] if code not in NOT_ASKED]
    assert not errors, f"{name}: {errors}"


@pytest.mark.parametrize("name", [*FUNCTIONS, *CLASSES_WITH_EXAMPLE])
def test_its_example_runs(name: str, examples: Path) -> None:
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    failures: list[str] = []
    for test in doctest.DocTestFinder(recurse=False).find(EXPORTED[name], name, globs={}):
        runner.run(test, out=failures.append)
    assert runner.summarize(verbose=False).attempted > 0, "no example"
    assert not failures, "".join(failures)
