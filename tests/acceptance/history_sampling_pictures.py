"""Pictures of the glow by the field and by sampling of the history, and of what either takes."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.report.figure_style import CHANNEL, DASHED, INK, MUTED, OTHER_CHANNELS, figure_style
from tests.acceptance.history_sampling import (
    CHECKED,
    FRAME_S,
    MAX_SAMPLES,
    Scene,
    disk,
    equal_quality,
    rms_percent,
    stepped,
)

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.axes import Axes


SIZE = 128
SHOWN_S = (1.0, 10.0, 100.0)
#: Samples of each state and texel that take about as long as the field's steps from the start.
SAMPLES_EACH_S = 2.5
#: Errors are drawn so many times as large as the glow is.
ENLARGED = 100
#: κ/k of the light whose saturation is drawn.
SATURATION = 3.0


def draw_disks(path: Path, name: str, saturation: float) -> None:
    """Draw the disk at three times: truth, field, and history at equal time, with errors."""
    from matplotlib.figure import Figure

    angle, is_on = disk(SIZE)
    scene = Scene.of(name, saturation, angle)
    glows, _ = stepped(scene, SHOWN_S)
    with figure_style():
        figure = Figure(figsize=(9.0, 5.9), layout="constrained")
        grid = figure.subplots(len(SHOWN_S), 5, squeeze=False)
        for row, (t_s, glow) in enumerate(zip(SHOWN_S, glows, strict=True)):
            fine = _ring(scene, t_s)
            n = round(SAMPLES_EACH_S * t_s)
            shown = {
                "rate equation": fine,
                "field": glow,
                f"field, error × {ENLARGED}": fine.mean() / 2 + ENLARGED * (glow - fine),
                "history, 1 sample": scene.history(t_s, 1, row, stratified=True),
                "history, equal time\nfrom the start": scene.history(t_s, n, row, stratified=True),
            }
            for column, (title, values) in enumerate(shown.items()):
                axes = grid[row, column]
                image = np.full(is_on.shape, np.nan)
                image[is_on] = values
                axes.imshow(image, cmap="gray", vmin=0, vmax=1.25 * fine.max())
                axes.set(xticks=[], yticks=[])
                for spine in axes.spines.values():
                    spine.set_visible(False)
                if not row:
                    axes.set_title(title, fontsize=9, color=INK)
                if "×" not in title and column:
                    said = f"rms {rms_percent(values, fine):.2g} %"
                    axes.set_xlabel(f"{n} samples, {said}" if column == 4 else said, fontsize=9)
            grid[row, 0].set_ylabel(f"{t_s:g} s", fontsize=10, color=INK)
        figure.savefig(path, dpi=110)


def draw_effort(path: Path, names: Sequence[str], saturation: float) -> None:
    """Draw how often the light is evaluated for a frame, and what saturation does to the law."""
    from matplotlib.figure import Figure

    with figure_style():
        figure = Figure(figsize=(9.0, 3.7), layout="constrained")
        effort, saturated = figure.subplots(1, 2)
        _draw_effort(effort, names, saturation)
        _draw_saturated(saturated, names[0])
        figure.savefig(path, dpi=110)


def _ring(scene: Scene, t_s: float) -> FloatArray:
    """Return the true glow of all texels, from that of a thousand angles."""
    even = np.linspace(-np.pi, np.pi, 1025).astype(np.float32)
    ring = Scene(even, scene.k_per_s, scene.kappa_per_s, scene.emitted)
    return np.interp(scene.angle, even, ring.truth(t_s, np.arange(len(even))))


def _draw_effort(axes: "Axes", names: Sequence[str], saturation: float) -> None:
    angle, _ = disk(64)
    times_s = tuple(np.geomspace(0.4, 1000, 12).round(2))
    checked = np.random.default_rng(1).choice(len(angle), CHECKED, replace=False)
    frames = [t_s / FRAME_S for t_s in times_s]
    axes.loglog(
        times_s, frames, color=MUTED, linestyle=DASHED, label="history, sum over all frames"
    )
    for name, colour in zip(names, (CHANNEL["B"], OTHER_CHANNELS[1]), strict=True):
        scene = Scene.of(name, saturation, angle[checked])
        whole = np.arange(CHECKED)
        glows, _ = stepped(scene, times_s)
        found = []
        for t_s, glow in zip(times_s, glows, strict=True):
            # Times of whole frames: the field has no others.
            at_s = round(t_s / FRAME_S) * FRAME_S
            truth = scene.truth(at_s, whole)
            n = equal_quality(scene, at_s, whole, truth, rms_percent(glow, truth))
            found.append(MAX_SAMPLES if n is None else n)
        axes.loglog(times_s, found, "o-", color=colour, markersize=3.5,
                    label=f"history, stratified: {name}")  # fmt: skip
    axes.loglog(times_s, np.ones(len(times_s)), color=INK, label="field")
    axes.set(xlabel="length of the history / s", ylabel="light on a texel evaluated for a frame",
             title="At the field's error")  # fmt: skip
    axes.legend(frameon=False, fontsize=8)


def _draw_saturated(axes: "Axes", name: str) -> None:
    times_s = np.arange(FRAME_S, 60, 4 * FRAME_S)
    scene = Scene.of(name, SATURATION, np.zeros(1, np.float32))
    glows, _ = stepped(scene, tuple(times_s))
    law = [
        float(scene.history(t_s, 2000, 1, stratified=True)[0])
        for t_s in np.round(times_s / FRAME_S) * FRAME_S
    ]
    at_s = times_s[:: len(times_s) // 24]
    truth = [float(scene.truth(t_s, np.arange(1))[0]) for t_s in at_s]
    unit = truth[-1]
    axes.plot(times_s, np.array(law) / unit, color=CHANNEL["R"],
              label="history (no saturation)")  # fmt: skip
    axes.plot(times_s, np.concatenate(glows) / unit, color=INK, label="field")
    axes.plot(at_s, np.array(truth) / unit, "o", color=INK, markersize=3.5, markerfacecolor="none",
              label="rate equation, 100,000 steps")  # fmt: skip
    axes.set(xlabel="time / s", ylabel="glow of a texel, relative", ylim=(0, None),
             title=f"{name}, κ/k = {SATURATION:g}")  # fmt: skip
    axes.legend(frameon=False, fontsize=8)
