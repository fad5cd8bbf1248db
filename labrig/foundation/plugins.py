"""Registry of drivers, protocols, analyses, results and reports by name, shipped or from packages.

A package adds its own by entry points: a driver in `labrig.drivers`; a protocol in
`labrig.protocols`, and under the same name its analysis in `labrig.analyses`, the type of its
result in `labrig.results` and, unless plain tables suffice, its part of a report in
`labrig.reports`; a kind of calibration, which a protocol measures, in `labrig.calibrations`.
"""

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import did_you_mean

DRIVERS = "labrig.drivers"
PROTOCOLS = "labrig.protocols"
ANALYSES = "labrig.analyses"
RESULTS = "labrig.results"
REPORTS = "labrig.reports"
CALIBRATIONS = "labrig.calibrations"
_KINDS = {
    DRIVERS: "driver",
    PROTOCOLS: "protocol",
    ANALYSES: "analysis of protocol",
    RESULTS: "result of protocol",
    REPORTS: "report of protocol",
    CALIBRATIONS: "kind of calibration",
}


def names(group: str) -> list[str]:
    """Return the registered names of a group, sorted."""
    return sorted(_registry()[group])


def load(group: str, name: str, source: str) -> Any:
    """Load the class or function registered as `name`; `source` names the requester in messages.

    Raises
    ------
    UsageError
        There is none of that name, or it cannot be imported.
    """
    registered = _registry()[group]
    kind = _KINDS[group]
    if name not in registered:
        raise UsageError(
            f"{source}: unknown {kind} '{name}'; {did_you_mean(name, list(registered))}"
        )
    try:
        return registered[name].load()
    except (ImportError, AttributeError) as error:
        raise UsageError(
            f"{source}: the {kind} '{name}' ({registered[name].value}) cannot be imported ({error})"
        ) from None


@cache
def _registry() -> dict[str, dict[str, EntryPoint]]:
    """Return all entry points by group and name; Python takes as long for one group as for all."""
    installed = entry_points()
    return {
        group: {entry.name: entry for entry in installed.select(group=group)} for group in _KINDS
    }
