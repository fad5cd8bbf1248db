"""A chain of protocols, from its frames to one material: each part uses what earlier ones found."""

from dataclasses import replace

from labrig.acquire import plugins
from labrig.errors import DataError, FitError
from labrig.material import write_material
from labrig.process.stage import Stage, StageResult


def process(stage: Stage) -> StageResult:
    """Process every part into a folder of its own.

    A part that cannot be processed is a warning, as long as another one can.

    Raises
    ------
    DataError, FitError
        No part can.
    """
    found, failures = StageResult(stage.known), []
    for part in stage.protocol.chain():
        folder = stage.folder / part.name
        folder.mkdir()
        run = stage.run.part(part.name)
        own = Stage(run, part.protocol, stage.rig, stage.choices, found.known, folder)
        process_part = plugins.load(
            plugins.PROCESSING, part.protocol.protocol, str(stage.run.folder)
        )
        try:
            found = _joined(found, process_part(own), part.name)
        except (DataError, FitError) as error:
            failures.append(error)
            found = replace(found, warnings=(*found.warnings, f"{part.name}: {error}"))
    if not found.sections:
        raise failures[0]
    if found.known.material is not None:
        write_material(stage.folder / "material.yaml", found.known.material)
    return found


def _joined(before: StageResult, after: StageResult, name: str) -> StageResult:
    return StageResult(
        known=after.known,
        sections=(*before.sections, *after.sections),
        lines=(*before.lines, *(f"{name}: {line}" for line in after.lines)),
        warnings=(*before.warnings, *(f"{name}: {warning}" for warning in after.warnings)),
    )
