"""Report of albedo and total radiance factor."""

from collections.abc import Mapping
from functools import partial

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from labrig.foundation.number_format import plus_minus
from labrig.protocols.reflectance.result import MeasuredReflectance, ReflectanceResult
from labrig.report.figure_style import (
    INK,
    LEFT_PT,
    OTHER_CHANNELS,
    SHADE,
    legend_above,
    line_entry,
    new_figure,
    place,
)
from labrig.report.sections import Picture, Rendered, Section, Source, Table

#: Wavelengths in nm of the lines for the terminal.
SHOWN_NM = (450, 550, 650)
#: Of 20 measured papers under illuminants A and D65, a sample of albedo 0.9.
CARD = (
    "the card is taken not to fluoresce; with white paper in its place the albedo would be up to "
    "0.12 too low in the blue"
)


def render(result: ReflectanceResult, source: Source) -> Rendered:
    """Render albedo and total radiance factor over wavelength."""
    lines = (
        f"{name}: {_line(patch)}" if name else _line(patch)
        for name, patch in result.patches.items()
    )
    return Rendered(
        tuple(_section(name, result) for name in result.patches), (*lines, f"not in σ: {CARD}")
    )


def _line(patch: MeasuredReflectance) -> str:
    """Return the line for the terminal: the albedo at some wavelengths."""
    shown = [int(abs(patch.wavelength_nm - nm).argmin()) for nm in SHOWN_NM]
    values = ", ".join(
        f"{plus_minus(patch.albedo[n], patch.albedo_sigma[n])} at {patch.wavelength_nm[n]:.0f} nm"
        for n in shown
    )
    return f"albedo {values}"


def _section(name: str, result: ReflectanceResult) -> Section:
    """Return the section of a patch with figure and table."""
    patch = result.patches[name]
    luminescence = plus_minus(patch.luminescence.value, patch.luminescence.sigma)
    rows = (
        (
            f"{nm:.0f}",
            plus_minus(patch.albedo[n], patch.albedo_sigma[n]),
            plus_minus(patch.radiance_factor[n], patch.radiance_factor_sigma[n]),
        )
        for n, nm in enumerate(patch.wavelength_nm)
    )
    return Section(
        f"Albedo of {name}" if name else "Albedo",
        (
            "The albedo is the fraction of the light that comes back at its own wavelength, "
            "relative to a diffuse white of reflectance 1; the total radiance factor has prompt "
            f"fluorescence and the steady glow in it, and belongs to the lamp ({result.lamp}).",
            f"Luminescence under the lamp is {luminescence} of the glow just after lamp off; "
            "without prompt fluorescence it is 1."
            if patch.luminescence.value == patch.luminescence.value
            else "Nothing glows after lamp off.",
            f"All numbers have {100 * patch.common_sigma:.1f} % in common, by the grey card and "
            f"the lamp; the fit's misfit is {patch.misfit:.2f}. Not in σ: {CARD}.",
        ),
        (
            Picture(
                f"albedo-{name}" if name else "albedo",
                partial(_figure, {"albedo": patch}),
                "Albedo (black) and total radiance factor (colour), with 1 σ.",
            ),
        ),
        (Table(("Wavelength / nm", "Albedo", "Radiance factor"), tuple(rows)),),
    )


def _figure(patches: Mapping[str, MeasuredReflectance]) -> Figure:
    """Draw albedo and total radiance factor over wavelength."""
    figure = new_figure(220.0)
    axes = place(figure, left=LEFT_PT, bottom=38, right=12, top=30)
    entries: list[Artist] = []
    for patch in patches.values():
        curves = (
            ("total radiance factor", patch.radiance_factor, patch.radiance_factor_sigma,
             OTHER_CHANNELS[0]),
            ("albedo", patch.albedo, patch.albedo_sigma, INK),
        )  # fmt: skip
        for label, value, sigma, colour in curves:
            axes.fill_between(
                patch.wavelength_nm, value - sigma, value + sigma, color=SHADE, linewidth=0
            )
            axes.plot(patch.wavelength_nm, value, color=colour, linewidth=1.2)
            entries.append(line_entry(label, colour))
    axes.set_ylim(0, None)
    axes.set_xlabel("Wavelength / nm")
    axes.set_ylabel("Albedo")
    legend_above(figure, entries, columns=2)
    return figure
