"""A chain of protocols, from its frames to a material of each patch.

Each part uses what earlier ones found.
"""

from dataclasses import replace
from typing import Any

from labrig import plugins, shipped
from labrig.analyse.part import Part, StageResult
from labrig.compare.beside import beside
from labrig.errors import DataError, FitError
from labrig.material import Material, read_material, write_material
from labrig.report import Section
from labrig.report.render import render
from labrig.report.rendering import Source


def process(part: Part) -> StageResult:
    """Process every part into a folder of its own; materials of several patches have one each.

    A part that cannot be processed is a warning, as long as another one can.

    Raises
    ------
    DataError, FitError
        No part can.
    """
    found, failures = StageResult(part.inputs), []
    for own in part.protocol.chain():
        folder = part.folder / own.name
        folder.mkdir()
        run = part.run.part(own.name)
        step = Part(run, own.protocol, part.rig, part.choices, found.known, folder)
        process_part = plugins.load(plugins.ANALYSES, own.protocol.protocol, str(part.run.folder))
        try:
            found = _joined(found, _as_stage(process_part(step), step), own.name)
        except (DataError, FitError) as error:
            failures.append(error)
            found = replace(found, warnings=(*found.warnings, f"{own.name}: {error}"))
    if not found.sections:
        raise failures[0]
    sections: list[Section] = []
    for patch, material in found.known.materials.items():
        place = part.folder / patch
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


def _as_stage(found: Any, step: Part) -> StageResult:
    """Until all protocols have a typed result."""
    if isinstance(found, StageResult):
        return found
    found.write_files(step.folder)
    rendered = render(found, Source(step.run, step.protocol, step.rig))
    inputs = replace(step.inputs, **found.provides())
    return StageResult(inputs, rendered.sections, rendered.lines, found.warnings)


def _joined(before: StageResult, after: StageResult, name: str) -> StageResult:
    return StageResult(
        known=after.known,
        sections=(*before.sections, *after.sections),
        lines=(*before.lines, *(f"{name}: {line}" for line in after.lines)),
        warnings=(*before.warnings, *(f"{name}: {warning}" for warning in after.warnings)),
    )
