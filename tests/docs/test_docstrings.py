"""Exported functions say all about themselves, by numpydoc's rules, and their examples run."""

import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
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


def exported() -> dict[str, Callable[..., Any]]:
    """Every exported function by the name of its shortest export."""
    found: dict[Any, str] = {}
    for face in faces():
        module = importlib.import_module(face)
        for name in module.__all__:
            member = getattr(module, name)
            if inspect.isfunction(member):
                found.setdefault(member, f"{face}.{name}")
    return {name: function for function, name in found.items()}


FUNCTIONS = exported()


def test_all_packages_are_looked_through() -> None:
    assert {"labrig.fit_decay", "labrig.optics.read_spectrum"} <= set(FUNCTIONS)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_parameters_returns_and_example_are_there(name: str) -> None:
    errors = [f"{code} {text}" for code, text in validate(name)["errors"] if code not in NOT_ASKED]
    assert not errors, f"{name}: {errors}"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_its_example_runs(name: str, examples: Path) -> None:
    function = FUNCTIONS[name]
    runner = doctest.DocTestRunner(optionflags=OPTIONS)
    said: list[str] = []
    for test in doctest.DocTestFinder(recurse=False).find(function, name, globs={}):
        runner.run(test, out=said.append)
    assert runner.summarize(verbose=False).attempted > 0, "no example"
    assert not said, "".join(said)
