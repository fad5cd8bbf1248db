"""A direct measurement of the same samples, with which estimates are compared."""

from collections.abc import Iterable
from pathlib import Path

from labrig.acquire import RigFile
from labrig.foundation.errors import UsageError
from labrig.protocols.direct_bispectral.result import DirectBispectralResult
from labrig.results import read_result


def direct_measurement(rig: RigFile) -> DirectBispectralResult | None:
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
    if not isinstance(result, DirectBispectralResult):
        raise UsageError(
            f"{named}: expected a run of direct_bispectral (optics: direct), got one of "
            f"{result.kind}; name another run, or leave the key out"
        )
    if len(result.lights) < 2:
        raise UsageError(
            f"{named}: expected a direct measurement under two lights or more, got one"
        )
    return result


def missing_samples(direct: DirectBispectralResult, names: Iterable[str]) -> list[str]:
    """Return a warning if no sample was measured directly under the name of a patch."""
    if any(name in direct.samples for name in names):
        return []
    return [
        f"optics: direct: no sample is called {' or '.join(names)}; it has "
        f"{', '.join(direct.samples)}, and nothing is compared"
    ]
