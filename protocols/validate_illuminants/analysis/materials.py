"""The matrices that a validation compares with photographs."""

from pathlib import Path
from typing import Any

from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, read_any_material
from labrig.results import read_result


def matrices_of(protocol: Any) -> dict[str, ReradiationMatrix]:
    """Return the matrix of each patch that the protocol's key `fluorescence` names.

    Raises
    ------
    UsageError
        None is named, the run is none of led_fluorescence or has other patches, or a material does
        not fluoresce or is relative.
    """
    named = protocol.fluorescence
    if named is None:
        raise UsageError(
            "expected 'fluorescence:' in the protocol, a run of led_fluorescence or a material for "
            "each patch; add it to the run's protocol.yaml, then process the run again"
        )
    if isinstance(named, str):
        return _of_run(named, list(protocol.patches))
    return {name: _of_material(named[name]) for name in protocol.patches}


def _of_run(run: str, patches: list[str]) -> dict[str, ReradiationMatrix]:
    result = read_result(Path(run))
    matrices = result.provides().get("matrices")
    if matrices is None:
        raise UsageError(f"{run}: expected a run of led_fluorescence, got one of {result.kind}")
    if missing := [name for name in patches if name not in matrices]:
        raise UsageError(
            f"{run}: expected a patch '{missing[0]}', got {', '.join(matrices) or 'none'}; "
            "give the patches the names that they had there"
        )
    return {name: matrices[name].named(name) for name in patches}


def _of_material(named: str) -> ReradiationMatrix:
    material = read_any_material(named)
    if not isinstance(material, ReradiationMatrix):
        raise UsageError(f"{named}: expected a fluorescent material, got a phosphor")
    if material.unit == "relative":
        raise UsageError(
            f"{named}: its re-radiation is relative, so that nothing can be predicted; expected "
            "fractions of the incident light"
        )
    return material
