"""Results in a notebook: the page, the figures, tables of pandas, fits with other options."""

import re
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

import labrig
from labrig.catalogue import Comparison
from labrig.design import Design, Keys, LightProgramme, solve, three_bands
from labrig.foundation.errors import UsageError
from labrig.foundation.notebook_views import NotebookViews
from labrig.foundation.plugins import measurements
from labrig.predict import Prediction
from labrig.results import FittedExcitation, LuminanceDecay, SharedDecay, TrapDepth
from tests.export.conftest import Finished

RATE = "Rate <i>k</i><sub><i>r</i></sub>"


def views(finished: Finished) -> Iterator[NotebookViews]:
    """Yield what a person reads, the smallest last."""
    result = labrig.read_result(finished.folder)
    assert isinstance(result, labrig.DecayResult)
    (patch,) = result.patches.values()
    assert patch.fit is not None
    yield from (result, patch, patch.fit, patch.series)
    yield labrig.read_run(finished.folder)
    yield labrig.read_material("blue-paint")


def test_every_type_of_result_has_the_views() -> None:
    types = [registered.load("result") for _, registered in measurements()]
    types += [labrig.FittedDecay, labrig.Series, labrig.Material, labrig.RunRecord]
    types += [FittedExcitation, LuminanceDecay, SharedDecay, TrapDepth]
    types += [Comparison, Design, Prediction]
    assert [each for each in types if not issubclass(each, NotebookViews)] == []


def test_a_page_has_the_numbers_of_the_report_and_a_style_of_its_own(finished: Finished) -> None:
    result, *others = views(finished)
    page, report = result._repr_html_(), (finished.folder / "result/report.html").read_text()
    cells = re.findall(r'<td class="number" data-label="(?:Rate|Amplitude)[^>]*>([^<]*)<', report)
    assert len(cells) >= 2
    for cell in cells:
        assert f">{cell}<" in page
    for each in (result, *others):
        page = each._repr_html_()
        assert page.count("<div") == page.count("</div")
        assert page.count("<section") == page.count("</section")
        assert "<script" not in page
        assert 'href="#' not in page
        (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
        assert re.match(r"\s*\.labrig-result \{.*\}\s*$", style, re.DOTALL)


def test_a_design_has_its_bands_and_its_glow() -> None:
    light = LightProgramme.checked([0.0, 10.0], [[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]])
    wanted = Keys.checked(0, [11.0, 30.0], [[0.001, 0.01, 0.002], [0.0001, 0.001, 0.0002]])
    design = solve(light, wanted, three_bands())
    bands = design.to_pandas("bands")
    assert bands["band"].tolist() == ["R", "G", "B"]
    np.testing.assert_allclose(bands["Λ of state 1"], design.reradiation[0])
    assert "Λ of state 1" in design._repr_html_()


@pytest.mark.drawn
def test_figures_are_asked_for_by_name(finished: Finished) -> None:
    for each in views(finished):
        figure = each.plot()
        assert figure.axes
        assert "<svg" in figure._repr_svg_()  # type: ignore[attr-defined]
    result = labrig.read_result(finished.folder)
    assert result.plot("resid").axes[0].get_ylabel() == "Residual / σ"
    with pytest.raises(UsageError, match="no figure 'residul'; did you mean 'residuals'"):
        result.plot("residul")


def test_a_table_has_the_numbers_of_its_file(finished: Finished) -> None:
    result = labrig.read_result(finished.folder)
    frame = result.to_pandas()
    read = labrig.read_series(finished.folder / "result" / "series.csv")
    np.testing.assert_array_equal(
        frame["G_sigma (DN/s)"], np.concatenate([part.sigma[:, 1] for part in read])
    )
    values = result.to_pandas("values").set_index("quantity")
    state = values.loc["patches.sample.fit.states.1.k_r_per_s"]
    (rate,) = finished.result.fits["sample"].rates
    assert (state.value, state.sigma, state.unit) == (rate.value, rate.sigma, "1/s")
    assert values.loc["patches.sample.fit.states.1.amplitude", "unit"] == "DN/s"
    assert not values.index.str.endswith("_sigma").any()
    with pytest.raises(UsageError, match="no table 'serie'"):
        result.to_pandas("serie")


def test_tables_of_several_patches_are_one_below_the_other(with_dark_patch: Finished) -> None:
    frame = labrig.read_result(with_dark_patch.folder).to_pandas("series")
    assert list(frame["of"].unique()) == ["Öl, 2 %", "Öl; 2 %"]


def test_without_pandas_one_line_names_the_remedy(
    finished: Finished, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"pip install 'labrig\[notebook\]'"):
        labrig.read_result(finished.folder).to_pandas()


def test_a_result_is_fitted_with_other_options_and_nothing_is_written(finished: Finished) -> None:
    before = {path: path.stat().st_mtime_ns for path in (finished.folder / "result").iterdir()}
    result = labrig.read_result(finished.folder)
    assert isinstance(result, labrig.DecayResult)
    again, two = result.refit(), result.refit(states=2)
    assert again.to_json() == result.to_json()
    assert [patch.fit and patch.fit.n_states for patch in two.patches.values()] == [2]
    assert two.refit(law="becquerel").fits["sample"].law == "becquerel"
    assert before == {
        path: path.stat().st_mtime_ns for path in (finished.folder / "result").iterdir()
    }
    with pytest.raises(UsageError, match="stats"):
        result.refit(stats=2)
    with pytest.raises(UsageError, match="belongs to no run folder"):
        labrig.DecayResult.from_dict(result.to_dict()).refit()


def test_reading_a_result_loads_no_view(finished: Finished) -> None:
    code = (
        "import sys, labrig; labrig.read_result(sys.argv[1]); print({'pandas', 'xarray', "
        "'matplotlib', 'jinja2', 'labrig.report', 'labrig.notebook'} & set(sys.modules))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, finished.folder], capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "set()"
