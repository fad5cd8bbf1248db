"""Modules of compiled functions, which need the extra `labrig[render]`."""

from importlib import import_module
from typing import Any

from labrig.errors import UsageError


def compiled(name: str) -> Any:
    """Return a module of this package; functions are compiled, or read from the cache, when used.

    Raises
    ------
    UsageError
        The extra is missing.
    """
    try:
        return import_module(f"labrig.reproduce.{name}")
    except ModuleNotFoundError as error:
        raise UsageError(
            f"labrig.reproduce needs an extra ({error.name} is missing): pip install "
            "'labrig[render]'"
        ) from None
