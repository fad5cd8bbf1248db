"""The report of a decay of many patches, against a bare page of matplotlib."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from labrig.protocols.decay.report import decay_sections
from labrig.report import exposure_middles_s, write_report
from labrig.report.report_model import PatchReport
from labrig.results import FittedDecay
from tests.report.made import decay_report, decay_series, page_of, patch

Against = Callable[..., None]

PATCHES = 50


@pytest.fixture(scope="module")
def patches() -> Sequence[PatchReport]:
    fitted = [patch(decay_series(36, seed=seed)) for seed in range(5)]
    return [replace(fitted[number % 5], name=f"paint {number}") for number in range(PATCHES)]


def test_report_of_many_patches(
    against: Against, patches: Sequence[PatchReport], tmp_path: Path
) -> None:
    report = decay_report(tmp_path, patches)
    against(
        lambda: write_report(tmp_path / "report.html", page_of(report)),
        {f"matplotlib: one plot a patch, {PATCHES} SVG": lambda: bare_page(patches, tmp_path)},
        rounds=3,
        what=f"report of {PATCHES} patches, 36 frames each",
    )


def test_sections_of_one_patch(
    against: Against, patches: Sequence[PatchReport], tmp_path: Path
) -> None:
    report = decay_report(tmp_path, patches[:1])
    against(
        lambda: decay_sections(report),
        {"matplotlib: one plot": lambda: bare_page(patches[:1], tmp_path)},
        rounds=5,
        what="sections of one patch, with its photographs",
    )


def bare_page(patches: Sequence[PatchReport], folder: Path) -> None:
    """A page with one plain plot of points and curves for each patch."""
    pictures = []
    for shown in patches:
        series, fit = shown.series, shown.fit
        assert isinstance(fit, FittedDecay)
        figure = Figure()
        axes = figure.subplots()
        t_s = exposure_middles_s(series)
        curve_s = np.linspace(series.t_s[0], series.t_s[-1], 160)
        curve = fit.predict(curve_s, np.ones(160))
        for number in range(len(series.channels)):
            axes.errorbar(t_s, series.values[:, number], series.sigma[:, number], fmt="o")
            axes.plot(curve_s, curve[:, number])
        axes.set(xlabel="t / s", ylabel="DN/s", yscale="log")
        buffer = BytesIO()
        figure.savefig(buffer, format="svg")
        uri = base64.b64encode(buffer.getvalue()).decode("ascii")
        pictures.append(f'<img src="data:image/svg+xml;base64,{uri}">')
    (folder / "bare.html").write_text("\n".join(pictures), encoding="utf-8")
