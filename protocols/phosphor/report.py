"""Report of a phosphor: the material as measured with its photographs, then every part."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from labrig.foundation import resources
from labrig.foundation.arrays import FloatArray
from labrig.material import Material, Spectrum, compare_materials, read_material
from labrig.protocols.phosphor.result import PhosphorResult
from labrig.record import FrameRecord, FrameRole
from labrig.report.colours import Screen, screen_for, spectrum_colour
from labrig.report.decay_figures import logarithmic_decay
from labrig.report.material_tables import comparison_table, measured_table
from labrig.report.phosphor_picture import bands_figure, has_bands
from labrig.report.photographs import Daylight, GlowPicture, daylight_picture, glow_pictures
from labrig.report.renderers import render_chain
from labrig.report.report_model import GlowPhotograph
from labrig.report.sections import Picture, Rendered, Section, Source, own_template
from labrig.report.spectrum_figure import spectrum_figure
from labrig.results import DecayPatch, ResultWithDecays

#: Legend entries of the emission spectrum and its band.
NAMES = "Emission", "± 1 σ"


@dataclass(frozen=True)
class _Overview:
    """Data for the template besides figures and tables.

    Attributes
    ----------
    daylight
        Photograph of the sample under the lamp; None without one.
    glow
        Photograph of the glow, if there is none under the lamp; else None.
    colours
        Colour of the emission as `#rrggbb`, by patch.
    contents
        Names of the parts that follow, by link target.
    failed
        Reason why a part is missing, by its name.
    """

    daylight: Daylight | None
    glow: GlowPicture | None
    colours: Mapping[str, str]
    contents: Mapping[str, str]
    failed: Mapping[str, str]


def render(result: PhosphorResult, source: Source) -> Rendered:
    """Render the material, every part of the chain, and the comparison with a reference."""
    comparisons = [
        section
        for patch, material in result.materials.items()
        for section in _comparison(patch, material)
    ]
    return render_chain(result.parts, source, _summary(result, source), comparisons)


def _summary(result: PhosphorResult, source: Source) -> Section:
    """Return the section with the material as measured, its photographs, and the list of parts."""
    colours = {}
    figures = [
        Picture(
            f"bands-{name}",
            partial(bands_figure, material),
            f"Excitation rates and re-radiation{_patch_suffix(name, result)} in bands, with ± 1 σ.",
        )
        for name, material in result.materials.items()
        if has_bands(material)
    ]
    for name, patch in _decays(result).items():
        figures.append(
            Picture(
                f"glow-{name}",
                logarithmic_decay(patch.series, patch.fit),
                f"The glow{_patch_suffix(name, result)} over time, with ± 1 σ; lines are the fit.",
            )
        )
    for name, material in result.materials.items():
        if material.spectrum is not None:
            nm, value = np.array(material.spectrum.wavelength_nm), np.array(material.spectrum.value)
            colours[name or material.name] = spectrum_colour(nm, value)
            figures.append(
                Picture(
                    f"spectrum-{name}",
                    partial(spectrum_figure, nm, value, _band(material.spectrum), NAMES),
                    f"Emission spectrum{_patch_suffix(name, result)}, largest value 1.",
                )
            )
    frames = [frame for attempt in source.run.completed().values() for frame in attempt.frames]
    screen = screen_for(source.camera)
    daylight = daylight_picture(
        [frame for frame in frames if frame.role == FrameRole.DAYLIGHT], (), screen
    )
    return Section(
        "The material as measured",
        figures=tuple(figures),
        tables=tuple(
            replace(measured_table(material), title=name if len(result.materials) > 1 else "")
            for name, material in result.materials.items()
        ),
        anchor="material",
        template=own_template(__file__, "phosphor"),
        content=_Overview(
            daylight,
            None if daylight else _first_glow(frames, result, screen),
            colours,
            {f"part-{name}": name for name in result.parts},
            result.failed,
        ),
    )


def _first_glow(
    frames: Sequence[FrameRecord], result: PhosphorResult, screen: Screen
) -> GlowPicture | None:
    """Return the first photograph of the decay; None if there is none that can be read."""
    for patch in _decays(result).values():
        first = int(np.argmin(patch.series.t_s))
        glowing = [
            GlowPhotograph(frame, float(patch.series.t_s[first]))
            for frame in frames
            if frame.path.name == patch.series.frame[first]
        ]
        return next(iter(glow_pictures(glowing, screen)), None)
    return None


def _decays(result: PhosphorResult) -> dict[str, DecayPatch]:
    """Return the patches of each sample's last decay that have a fit, by name."""
    decays = {
        name.rpartition("/")[0]: part
        for name, part in result.parts.items()
        if isinstance(part, ResultWithDecays)
    }
    return {
        sample or name: patch
        for sample, decay in decays.items()
        for name, patch in decay.patches.items()
        if patch.fit is not None
    }


def _patch_suffix(patch: str, result: PhosphorResult) -> str:
    """Return the patch as part of a caption, empty if there is only one."""
    return f" of {patch}" if patch and len(result.materials) > 1 else ""


def _band(spectrum: Spectrum) -> tuple[FloatArray, FloatArray] | None:
    """Return the spectrum less and plus 1 σ; None if σ is not known."""
    if spectrum.sigma is None:
        return None
    value, sigma = np.array(spectrum.value), np.array(spectrum.sigma)
    return value - sigma, value + sigma


def _comparison(patch: str, material: Material) -> tuple[Section, ...]:
    """Return the section that compares the material with the shipped one of its name, if any."""
    references = resources.names("config/materials")
    if material.name not in references:
        return ()
    reference = read_material(references[material.name])
    source = reference.provenance.source if reference.provenance else "labrig"
    text = (
        f"Beside {material.name} of {source}. k_e and Λ are rescaled here, since their scales are "
        "free in every laboratory; as measured, the numbers stand at the beginning."
    )
    table = comparison_table(compare_materials(material, reference))
    title = f"Compared with a reference: {patch}" if patch else "Compared with a reference"
    return (Section(title, (text,), tables=(table,), part="compared_with_a_reference"),)
