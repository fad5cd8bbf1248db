"""A phosphor as a picture: excitation and re-radiation of each state over wavelength."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.errors import UsageError
from labrig.foundation.number_format import rounded
from labrig.material import Material, State
from labrig.report.figure_files import require_picture, save_picture
from labrig.report.figure_style import INK, LEFT_PT, OTHER_CHANNELS, figure_style, new_figure, place
from labrig.report.material_tables import UNITS

#: Name of the panel of the albedo among those of the states' quantities.
ALBEDO = "albedo"

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: Height of a panel of the figure of bands in points, with the distance to the next.
PANEL_PT = 130.0
_BANDS_PANELS = (("k_e_per_s", "kₑ / s⁻¹"), ("reradiation", "Λ"))


def draw_phosphor(material: Material, path: Path) -> None:
    """Draw excitation rates, re-radiation and emission spectrum of a phosphor.

    Parameters
    ----------
    material
        A phosphor with excitation rates or re-radiation in bands, or with a spectrum.
    path
        Path of the picture, which ends in `.png`, `.svg` or `.pdf`.

    Raises
    ------
    UsageError
        There is nothing to draw, or the file name is not that of a picture.
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.report import draw_phosphor
    >>> draw_phosphor(labrig.read_material("blue-paint"), Path("blue-paint.svg"))
    """
    from matplotlib.figure import Figure

    require_picture(path)
    panels = [
        (name, label)
        for name, label in (
            ("k_e_per_s", "excitation rate kₑ / s⁻¹"),
            ("reradiation", f"re-radiation Λ{UNITS[material.scale][1] or ', relative'}"),
        )
        if any(getattr(state, name) is not None for state in material.states)
    ]
    if material.albedo is not None:
        panels.append((ALBEDO, "albedo"))
    if not panels:
        raise UsageError(
            f"{material.name}: expected excitation rates, re-radiation or an albedo to draw, got "
            "decay rates only"
        )
    with figure_style():
        figure = Figure(figsize=(4.5 * len(panels), 3.4), layout="constrained")
        figure.suptitle(material.name, color=INK)
        for axes, (name, label) in zip(
            np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True
        ):
            if name == ALBEDO:
                _draw_albedo(axes, material)
            else:
                _draw_bands(axes, material, name)
            axes.set(xlabel="wavelength / nm")
            axes.set_title(label, fontsize="medium", color=INK)
        save_picture(figure, path)


def bands_figure(material: Material) -> "Figure":
    """Return the figure of excitation rates and re-radiation of every state over the wavelength."""
    panels = [
        (name, label)
        for name, label in _BANDS_PANELS
        if any(getattr(state, name) is not None for state in material.states)
    ]
    height_pt = 52 + PANEL_PT * len(panels)
    figure = new_figure(height_pt)
    for number, (name, label) in enumerate(panels):
        top = 8 + PANEL_PT * number
        bottom = height_pt - top - PANEL_PT + 10
        axes = place(figure, left=LEFT_PT, bottom=bottom, right=12, top=top)
        _draw_bands(axes, material, name)
        unit = UNITS[material.scale][1] or ", relative"
        axes.set_ylabel(label + (unit if name == "reradiation" else ""))
        axes.tick_params(labelbottom=number == len(panels) - 1)
    axes.set_xlabel("Wavelength / nm")
    return figure


def has_bands(material: Material) -> bool:
    """Return whether there is anything that `bands_figure` draws."""
    return any(
        getattr(state, name) is not None for state in material.states for name, _ in _BANDS_PANELS
    )


def _label(state: State) -> str:
    """Return what tells a state from others: its lifetime, or order and τ after its charge."""
    if state.kinetic_order == 1:
        return f"1/kᵣ = {rounded(1 / state.k_r_per_s, 3)} s"
    order = f"b = {rounded(state.kinetic_order, 3)}"
    time_s = state.decay_time_of_rate_s
    return order if time_s is None else f"{order}, τ = {rounded(time_s, 3)} s"


def _draw_albedo(axes: "Axes", material: Material) -> None:
    """Draw albedo and total radiance factor with ± 1 σ."""
    curves = (
        (material.albedo, INK, "albedo"),
        (material.radiance_factor, OTHER_CHANNELS[0], "radiance factor under the lamp"),
    )
    for curve, colour, label in curves:
        if curve is not None:
            axes.errorbar(
                curve.wavelength_nm, curve.value, curve.sigma, color=colour, linewidth=1.4,
                capsize=2, label=label,
            )  # fmt: skip
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize="small", labelcolor=INK)


def _draw_bands(axes: "Axes", material: Material, name: str) -> None:
    """Draw one quantity of every state as steps with ± 1 σ."""
    edges_nm = np.array(material.bands_nm)
    states = sorted(material.states, key=lambda state: -state.k_r_per_s)
    for state, colour in zip(states, OTHER_CHANNELS, strict=False):
        values, sigmas = getattr(state, name), getattr(state, f"{name}_sigma")
        if values is None:
            continue
        axes.stairs(
            values, edges_nm, color=colour, linewidth=1.4,
            label=_label(state),
        )  # fmt: skip
        if sigmas is not None:
            middles_nm = (edges_nm[1:] + edges_nm[:-1]) / 2
            axes.errorbar(middles_nm, values, sigmas, color=colour, linestyle="", capsize=2)
    if name == "reradiation" and material.spectrum is not None:
        spectrum = material.spectrum
        top = max(max(getattr(state, name) or (0.0,)) for state in states)
        axes.plot(
            spectrum.wavelength_nm, top * np.array(spectrum.value), color=INK, linewidth=0.9,
            linestyle="--", label="spectrum, scaled",
        )  # fmt: skip
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize="small", labelcolor=INK)
