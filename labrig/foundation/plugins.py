"""Registry of drivers and measurements by name, shipped or from packages.

A package adds its own by entry points: a driver's class in `labrig.drivers`, the `Measurement` that
registers a measurement in `labrig.measurements`.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Literal

from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import did_you_mean

DRIVERS = "labrig.drivers"
MEASUREMENTS = "labrig.measurements"
_KINDS = {DRIVERS: "driver", MEASUREMENTS: "protocol"}


Part = Literal["protocol", "result", "analysis", "report", "options", "table_report", "calibration"]


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """Registration of a measurement: where its parts are, and how it takes part in chains.

    Parts are import strings `module:name`; a module that begins with a dot is one of `package`. No
    part is imported before it is asked for, so that a plan loads no fit and a fit no report.

    Attributes
    ----------
    package
        Package with the measurement's parts and its commented example, `<name>.yaml`.
    protocol
        Model of the protocol file, a `ProtocolModel`.
    result
        Type of the result, a `RunResult`.
    analysis
        Function that analyses an `AnalysisContext` to the result.
    report
        Function that renders the result; None for plain tables of its fields.
    options
        Model of its own options of `labrig process`, a `ProcessOptions`; None where it has none.
    table_report
        Function that renders the result of another program's table; None where there is no such.
    calibration
        The `CalibrationKind` that it measures; None for other measurements.
    of
        What is measured: a `bench`, once for all samples, or each `sample`.
    is_per_patch
        Whether it measures every patch of a chain that names patches.
    needs_checked_bench
        Whether a chain on a bench that was calibrated before first checks that nothing moved.
    is_bench_check
        Whether it is that check.
    is_of_fluorescence
        Whether it measures fluorescence, of samples that need no charge.
    has_short_charges
        Whether its charges are short: in a chain it comes before those that charge for long, so
        that nothing waits for their glow to fade.

    Examples
    --------
    >>> from labrig.foundation.plugins import measurement
    >>> decay = measurement("decay")
    >>> decay.of, decay.load("protocol").__name__, decay.example.name
    ('sample', 'Decay', 'decay.yaml')
    """

    package: str
    protocol: str
    result: str
    analysis: str = ".analysis:analyse"
    report: str | None = ".report:render"
    options: str | None = None
    table_report: str | None = None
    calibration: str | None = None
    of: Literal["bench", "sample"] = "sample"
    is_per_patch: bool = False
    needs_checked_bench: bool = False
    is_bench_check: bool = False
    has_short_charges: bool = False
    is_of_fluorescence: bool = False

    def load(self, part: Part) -> Any:
        """Import a part; None if there is none.

        Raises
        ------
        UsageError
            It cannot be imported.
        """
        named: str | None = getattr(self, part)
        if named is None:
            return None
        try:
            return resolve_name(self.package + named if named.startswith(".") else named)
        except (ImportError, AttributeError) as error:
            raise UsageError(
                f"{self.package}: the {part} ({named}) cannot be imported ({error})"
            ) from None

    @property
    def folder(self) -> Path:
        """Folder of the package, with its protocol files."""
        module = resolve_name(self.package)
        if not hasattr(module, "__path__"):
            raise UsageError(f"{self.package}: expected a package, a folder with an __init__.py")
        return Path(next(iter(module.__path__))).resolve()

    @property
    def example(self) -> Path:
        """Path of the commented example, whether it exists or not."""
        return self.folder / f"{self.package.rpartition('.')[2]}.yaml"


def measurement(name: str, source: str = "protocols") -> Measurement:
    """Return the measurement of a protocol's name; `source` names the requester in messages.

    Raises
    ------
    UsageError
        There is none of that name, or its registration cannot be imported.
    """
    registered: Measurement = load(MEASUREMENTS, name, source)
    return registered


def measurements() -> Iterator[tuple[str, Measurement]]:
    """Yield all measurements with their names, sorted.

    One of a package that cannot be imported is left out, so that all others go on; whoever names it
    is told by `measurement`.
    """
    for name in names(MEASUREMENTS):
        with suppress(UsageError):
            yield name, measurement(name)


def bench_check() -> str:
    """Return the name of the measurement that checks a calibrated bench."""
    return next(name for name, registered in measurements() if registered.is_bench_check)


def names(group: str) -> list[str]:
    """Return the registered names of a group, sorted."""
    return sorted(_registry()[group])


def load(group: str, name: str, source: str) -> Any:
    """Load the class or registration of a name; `source` names the requester in messages.

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
