"""Analysis of a chain of protocols, to the results of its parts and the materials from them."""

from labrig import plugins
from labrig.analyse.inputs import Part
from labrig.analyse.surface import with_reflectances
from labrig.errors import DataError, FitError
from labrig.results import PhosphorResult, RunResult


def analyse(part: Part) -> PhosphorResult:
    """Analyse every part of a chain; each may use the results of earlier ones.

    A part that cannot be analysed is a warning, as long as another one can.

    Raises
    ------
    DataError, FitError
        No part can be analysed.
    """
    parts: dict[str, RunResult] = {}
    failures: dict[str, DataError | FitError] = {}
    warnings: list[str] = []
    inputs = part.inputs
    for link in part.protocol.chain():
        kind = link.protocol.protocol
        analyse_link = plugins.load(plugins.ANALYSES, kind, str(part.run.folder))
        link_part = Part(part.run.part(link.name), link.protocol, part.rig, part.overrides, inputs)
        try:
            result: RunResult = analyse_link(link_part)
            if result.failures():
                raise FitError("; ".join(result.failures()))
        except (DataError, FitError) as error:
            failures[link.name] = error
            warnings.append(f"{link.name}: {error}")
            continue
        parts[link.name] = result
        warnings += [f"{link.name}: {warning}" for warning in result.warnings]
        inputs = inputs.updated_by(result)
    if not parts:
        raise next(iter(failures.values()))
    return PhosphorResult(
        parts=parts,
        failed={name: str(error) for name, error in failures.items()},
        materials=with_reflectances(inputs.materials, inputs.reflectance),
        warnings=tuple(warnings),
    )
