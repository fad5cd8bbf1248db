"""Warnings in tests: their codes, and the only one of a code."""

from collections.abc import Iterable

from labrig.foundation.result_warning import ResultWarning


def codes(warnings: Iterable[ResultWarning]) -> list[str]:
    """Return the codes of warnings, in their order."""
    return [each.code for each in warnings]


def of_code(warnings: Iterable[ResultWarning], code: str) -> ResultWarning:
    """Return the only warning of a code; an assertion fails if there is none, or several."""
    (warning,) = (each for each in warnings if each.code == code)
    return warning
