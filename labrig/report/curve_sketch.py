"""Sketches of measured curves, as lines of text or as a picture."""

import textwrap
from pathlib import Path

import numpy as np

from labrig.foundation import resources
from labrig.foundation.input_file import read_text
from labrig.foundation.number_format import aligned
from labrig.optics import (
    Curve,
    CurveFile,
    band_means,
    read_camera,
    shipped_cameras,
)
from labrig.report.figure_files import require_picture, save_picture

#: Bars of 0 to 8 eighths of the height of a line of text.
BARS = " ▁▂▃▄▅▆▇█"
COLUMNS = 48
#: Width of a terminal.
WIDTH = 100
#: Largest number of curves that are described; a catalogue has hundreds.
MAX_CURVES = 12
_COLOURS = {"R": "#c4372c", "G": "#1b8450", "B": "#2b62c9"}


def describe_curves(file: CurveFile) -> str:
    """Describe the curves of a file in lines of text.

    Parameters
    ----------
    file
        Measured curves over wavelength, such as those of a camera or a filter.

    Returns
    -------
    str
        Title, number of curves and path of the file; then the grid, range and peak of each of the
        first 12 curves, and a line of bars with its shape; then what was converted or left out.

    Examples
    --------
    >>> from labrig.optics import read_checked_curves
    >>> from labrig.report import describe_curves
    >>> print(describe_curves(read_checked_curves("canon_eos_5d_mark_ii", ["G"])))
    Canon EOS 5D Mark II: one curve (...canon_eos_5d_mark_ii.json)
      G  380-780 nm, step 5; 0.000163 to 1, highest at 520 nm
         |      ▁▁▁▁▂▃▅▆▇█████▇▇▆▅▄▃▂▁▁                   |
    """
    curves = list(file.curves.items())
    count = "one curve" if len(curves) == 1 else f"{len(curves)} curves"
    lines = [f"{file.title}: {count} ({file.path})"]
    widest = max(len(name) for name, _ in curves[:MAX_CURVES])
    lines += [_describe_curve(name.ljust(widest), curve) for name, curve in curves[:MAX_CURVES]]
    if len(curves) > MAX_CURVES:
        lines.append(f"and {len(curves) - MAX_CURVES} more; choose with --curve NAME")
    noted = (note for name in file.curves for note in file.notes.get(name, ()))
    lines += [f"note: {note}" for note in dict.fromkeys(noted)]
    return "\n".join(lines)


def describe_shipped_curves() -> str:
    """Describe the shipped cameras, curves and colour filters in lines of text.

    Returns
    -------
    str
        Name of each, with maker and model, or what it is.

    Examples
    --------
    >>> from labrig.report import describe_shipped_curves
    >>> print(describe_shipped_curves().splitlines()[2])
      arri_d21                   ARRI D21                  every channel scaled to 1
    """
    cameras = [
        [
            f"  {shipped.name}",
            f"{shipped.maker} {shipped.model}",
            "" if read_camera(shipped.path).has_ratios else "every channel scaled to 1",
        ]
        for shipped in shipped_cameras()
    ]
    folder = resources.folder("config/optics")
    others = [[f"  {path.stem}", _first_sentence(path)] for path in sorted(folder.glob("*.csv"))]
    filters = ", ".join(sorted(path.stem for path in (folder / "filters").glob("*.csv")))
    return "\n".join(
        [
            "cameras; where a rig file names none, that of the frames is taken if it is here:",
            *aligned(cameras),
            "other curves:",
            *aligned(others),
            "colour filters, made up for the simulated rigs:",
            *textwrap.wrap(filters, WIDTH, initial_indent="  ", subsequent_indent="  "),
        ]
    )


def _first_sentence(path: Path) -> str:
    """Return what the comment of a table begins with."""
    line = read_text(path).partition("\n")[0]
    return line.removeprefix("# ").partition(". ")[0].strip().rstrip(".")


def _describe_curve(name: str, curve: Curve) -> str:
    """Return the line of text with grid, range and peak of a curve, and the line of its shape."""
    nm, value = curve.wavelength_nm, curve.value
    steps = np.diff(nm)
    grid = f"step {steps[0]:g}" if np.ptp(steps) < 1e-6 else f"{len(nm)} points"
    # Relative to the largest, since integrals of the largest floating-point numbers are infinite.
    relative = value / max(float(np.abs(value).max()), 1e-300)
    means = band_means(nm, relative, np.linspace(nm[0], nm[-1], COLUMNS + 1))
    top = max(float(means.max()), 1e-300)
    levels = np.clip(np.rint(means / top * (len(BARS) - 1)), 0, len(BARS) - 1).astype(int)
    bars = "".join(BARS[level] for level in levels)
    return (
        f"  {name}  {nm[0]:g}-{nm[-1]:g} nm, {grid}; {value.min():.3g} to {value.max():.3g}, "
        f"highest at {nm[value.argmax()]:g} nm\n  {' ' * len(name)}  |{bars}|"
    )


def draw_curves(file: CurveFile, path: Path) -> None:
    """Draw all curves of a file over wavelength, with bands of ± 1 σ where σ is known.

    Parameters
    ----------
    file
        Measured curves over wavelength, such as those of a camera or a filter.
    path
        Path of the picture, which ends in `.png`, `.svg` or `.pdf`.

    Raises
    ------
    UsageError
        If the file name is not that of a picture.
    DiskError
        If the file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.optics import read_checked_curves
    >>> from labrig.report import draw_curves
    >>> camera = read_checked_curves("canon_eos_5d_mark_ii")
    >>> draw_curves(camera, Path("camera.svg"))
    >>> draw_curves(camera, Path("camera.bmp"))
    Traceback (most recent call last):
    labrig.foundation.errors.UsageError: camera.bmp: expected a file name ...
    """
    from matplotlib.figure import Figure  # slow to load

    require_picture(path)
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, curve in file.curves.items():
        line = axes.plot(*curve[:2], label=name, color=_COLOURS.get(name), linewidth=1.2)[0]
        if curve.sigma is not None:
            low, high = curve.value - curve.sigma, curve.value + curve.sigma
            axes.fill_between(curve.wavelength_nm, low, high, color=line.get_color(), alpha=0.25)
    axes.set(xlabel="Wavelength / nm", title=file.title)
    if 1 < len(file.curves) <= MAX_CURVES:
        axes.legend(frameon=False)
    save_picture(figure, path)
