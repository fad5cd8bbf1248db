"""Analysis of a bench's calibration, to the results of its parts and the bench they belong to."""

from labrig.analyse.bench_reference import bench_reference, card_picture
from labrig.analyse.chain import analyse_parts
from labrig.analyse.inputs import Part
from labrig.calibration import (
    LVF_KIND,
)
from labrig.protocols.calibration.result import CalibrationResult


def analyse(part: Part) -> CalibrationResult:
    """Analyse every part, and describe the bench by which later runs know it again.

    Raises
    ------
    DataError, FitError
        No part can be analysed.
    """
    analysed = analyse_parts(part)
    lvf = analysed.inputs[""][LVF_KIND]
    pictures = [
        card_picture(_part_of(part, link.name, link.protocol), lvf)
        for link in part.protocol.chain()
        if link.protocol.protocol == LVF_KIND.protocol
        and link.name in analysed.results
        and lvf is not None
    ]
    return CalibrationResult(
        parts=analysed.results,
        failed=analysed.failed,
        reference=bench_reference(part, pictures[-1] if pictures else None, set(analysed.results)),
        warnings=analysed.warnings,
    )


def _part_of(part: Part, name: str, protocol: object) -> Part:
    return Part(part.run.part(name), protocol, part.rig, part.overrides, part.inputs)
