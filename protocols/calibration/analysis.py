"""Analysis of a bench's calibration, to the results of its parts and the bench they belong to."""

from labrig.analyse.bench_reference import bench_reference, card_picture
from labrig.analyse.inputs import AnalysisContext, analyse_parts
from labrig.calibration import (
    LVF_KIND,
)
from labrig.protocols.calibration.result import CalibrationResult


def analyse(context: AnalysisContext) -> CalibrationResult:
    """Analyse every part, and describe the bench by which later runs know it again.

    Raises
    ------
    DataError, FitError
        No part can be analysed.
    """
    analysed = analyse_parts(context)
    lvf = analysed.inputs[""][LVF_KIND]
    pictures = [
        card_picture(_part_of(context, link.name, link.protocol), lvf)
        for link in context.protocol.chain()
        if link.protocol.protocol == LVF_KIND.protocol
        and link.name in analysed.results
        and lvf is not None
    ]
    return CalibrationResult(
        parts=analysed.results,
        failed=analysed.failed,
        reference=bench_reference(
            context, pictures[-1] if pictures else None, set(analysed.results)
        ),
        warnings=analysed.warnings,
    )


def _part_of(context: AnalysisContext, name: str, protocol: object) -> AnalysisContext:
    return AnalysisContext(
        context.run.part(name), protocol, context.rig, context.overrides, context.inputs
    )
