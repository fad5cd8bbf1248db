"""Analysis of a chain of protocols, to the results of its parts and the materials from them."""

from collections.abc import Mapping

from labrig.analyse.inputs import AnalysisContext, Inputs, analyse_parts
from labrig.analyse.surface import with_reflectances
from labrig.calibration import REFLECTANCE_KIND
from labrig.material import Material
from labrig.protocols.phosphor.result import PhosphorResult


def analyse(context: AnalysisContext) -> PhosphorResult:
    """Analyse every part of a chain; each may use the results of earlier ones.

    Raises
    ------
    DataError, FitError
        No part can be analysed.
    """
    analysed = analyse_parts(context)
    return PhosphorResult(
        parts=analysed.results,
        failed=analysed.failed,
        materials=_materials(analysed.inputs),
        warnings=analysed.warnings,
    )


def _materials(inputs: Mapping[str, Inputs]) -> dict[str, Material]:
    """Return the materials by patch, or by sample."""
    return {
        sample or patch: material
        for sample, known in inputs.items()
        for patch, material in with_reflectances(known.materials, known[REFLECTANCE_KIND]).items()
    }
