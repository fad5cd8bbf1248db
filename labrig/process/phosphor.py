"""A chain of protocols, from its frames to a material of each patch.

Each part uses what earlier ones found.
"""

from dataclasses import replace

from labrig import shipped
from labrig.acquire import plugins
from labrig.compare.beside import beside
from labrig.errors import DataError, FitError
from labrig.material import Material, read_material, write_material
from labrig.process.stage import Stage, StageResult
from labrig.report import Section


def process(stage: Stage) -> StageResult:
    """Process every part into a folder of its own; materials of several patches have one each.

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
    sections: list[Section] = []
    for patch, material in found.known.materials.items():
        place = stage.folder / patch
        place.mkdir(exist_ok=True)
        write_material(place / "material.yaml", material)
        sections += _beside_the_paper(f"Material: {patch}" if patch else "Material", material)
    return replace(found, sections=(*sections, *found.sections))


def _beside_the_paper(title: str, material: Material) -> tuple[Section, ...]:
    """The material beside the shipped one of its name, such as of Table 1, if there is one."""
    known = shipped.names("config/materials")
    if material.name not in known:
        return ()
    reference = read_material(known[material.name])
    source = reference.provenance.source if reference.provenance else "labrig"
    text = f"What was measured, beside {material.name} of {source}."
    return (Section(title, (text,), (), (beside(material, reference).table(),)),)


def _joined(before: StageResult, after: StageResult, name: str) -> StageResult:
    return StageResult(
        known=after.known,
        sections=(*before.sections, *after.sections),
        lines=(*before.lines, *(f"{name}: {line}" for line in after.lines)),
        warnings=(*before.warnings, *(f"{name}: {warning}" for warning in after.warnings)),
    )
