"""A direct measurement of the same samples, with which estimates are compared."""

from collections.abc import Iterable
from pathlib import Path

from labrig.acquire import RigFile
from labrig.foundation.errors import UsageError
from labrig.results import DirectMeasurement, read_result


def direct_measurement(rig: RigFile) -> DirectMeasurement | None:
    """Read the direct measurement that a rig file names; None if it names none.

    Raises
    ------
    UsageError, DataError
        There is no such run, it has no result, or it is another protocol's.
    """
    named = rig.optics.direct
    if named is None:
        return None
    result = read_result(Path(named))
    direct: DirectMeasurement | None = result.provides().get("direct")
    if direct is None:
        raise UsageError(
            f"{named}: expected a run of direct_bispectral (optics: direct), got one of "
            f"{result.kind}; name another run, or leave the key out"
        )
    if len(direct.lights) < 2:
        raise UsageError(
            f"{named}: expected a direct measurement under two lights or more, got one"
        )
    return direct


def missing_samples(direct: DirectMeasurement, names: Iterable[str]) -> list[str]:
    """Return a warning if no sample was measured directly under the name of a patch."""
    if any(name in direct.samples for name in names):
        return []
    return [
        f"optics: direct: no sample is called {' or '.join(names)}; it has "
        f"{', '.join(direct.samples)}, and nothing is compared"
    ]
