"""Analysis of a chain of protocols, to the results of its parts and the materials from them."""

from labrig.analyse.chain import analyse_parts
from labrig.analyse.inputs import Part
from labrig.analyse.surface import with_reflectances
from labrig.results import PhosphorResult


def analyse(part: Part) -> PhosphorResult:
    """Analyse every part of a chain; each may use the results of earlier ones.

    Raises
    ------
    DataError, FitError
        No part can be analysed.
    """
    analysed = analyse_parts(part)
    return PhosphorResult(
        parts=analysed.results,
        failed=analysed.failed,
        materials=with_reflectances(analysed.inputs.materials, analysed.inputs.reflectance),
        warnings=analysed.warnings,
    )
