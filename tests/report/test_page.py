"""The page: everything is on it, nothing is fetched, nothing breaks it."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from labrig.fit import DecayFit
from labrig.foundation.errors import DiskError
from labrig.foundation.number_format import plus_minus
from labrig.foundation.result_warning import as_warnings
from labrig.record.history import Interruption
from labrig.report import write_report
from labrig.report.parameters import quality_rows
from labrig.report.report_model import DecayReport, PatchReport

from .made import decay_report, decay_series, page_of, patch

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Text, ids and references of a page; complains of tags that do not match."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: list[str] = []
        self.text = ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            elif name in ("href", "src", "xlink:href"):
                self.references.append(value or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text += data


def written(folder: Path, report: DecayReport, warnings: Sequence[str] = ()) -> str:
    write_report(folder / "report.html", page_of(report, warnings))
    return (folder / "report.html").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Made:
    """A report that was written."""

    report: DecayReport
    folder: Path
    text: str


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A report without anything special."""
    folder = tmp_path_factory.mktemp("plain")
    report = decay_report(folder)
    return Made(report, folder, written(folder, report))


def test_all_numbers_are_on_the_page(plain: Made) -> None:
    report, page = plain.report, Page(plain.text)
    fit = report.patches[0].fit
    assert isinstance(fit, DecayFit)
    assert fit.n_states == 2
    for state in fit.states:
        assert plus_minus(state.k_r_per_s, state.k_r_per_s_sigma) in page.text
        assert plus_minus(state.amplitude, state.amplitude_sigma) in page.text
        lifetime_s = 1 / state.k_r_per_s
        assert plus_minus(lifetime_s, state.k_r_per_s_sigma * lifetime_s**2) in page.text
    for expected in (
        "blue-paint",
        report.about.run,
        "thickness",
        "Numato relay 00000009",
        "COM3",
        "protocol: decay",
        "1.2.3",
        "Reduced χ²",
        "Flicker",
        "Offset",
        "Becquerel's law",
        "not determined separately by a decay alone",
        "No warnings.",
        f"{101:064x}",
        "σ of a value",
        "Methods",
        "doi:10.1111/cgf.13136",
        "1/64 s",
    ):
        assert expected in page.text
    assert page.tags.count("img") == 1 + 2 * 2
    assert page.tags.count("li") >= 18


def test_offsets_are_one_row_a_channel_if_any_is_fitted() -> None:
    fit = patch(decay_series()).fit
    assert isinstance(fit, DecayFit)
    moved = replace(fit, offsets=(1.5, -0.8, 0.0), offsets_sigma=(0.4, 0.3, 0.0))
    offsets = [
        (row.quantity, *row.values)
        for row in quality_rows(moved)
        if row.quantity.startswith("Offset")
    ]
    assert offsets == [
        ("Offset of R", "1.50 ± 0.40"),
        ("Offset of G", "−0.80 ± 0.30"),
        ("Offset of B", "0 (held)"),
    ]
    assert [row.values for row in quality_rows(fit) if row.quantity == "Offset"] == [("0 (held)",)]


def test_nothing_is_fetched(plain: Made) -> None:
    text, page = plain.text, Page(plain.text)
    beside = {ref.partition("#")[0] for ref in page.references if ref.startswith("figures/")}
    assert beside == {f"figures/{path.name}" for path in (plain.folder / "figures").iterdir()}
    others = set(page.references) - {ref for ref in page.references if ref.startswith("figures/")}
    assert all(reference.startswith(("#", "data:image/")) for reference in others)
    for forbidden in ("http:", "https:", "@import", 'src="figures', "<link", "@font-face"):
        assert forbidden not in text


def test_ids_are_unique_and_references_lead_somewhere(tmp_path: Path) -> None:
    patches = [patch(decay_series(seed=n, name=f"patch {n}")) for n in (1, 2)]
    text = written(tmp_path, decay_report(tmp_path, patches))
    page = Page(text)
    assert len(page.ids) == len(set(page.ids))
    wanted = {ref[1:] for ref in page.references if ref.startswith("#")}
    wanted |= set(re.findall(r"url\(#([^)]+)\)", text))
    assert wanted <= set(page.ids)


def test_warnings_stand_before_everything_else(tmp_path: Path) -> None:
    text = written(tmp_path, decay_report(tmp_path), ["2 frames are clipped"])
    page = Page(text)
    assert page.text.index("1 warning") < page.text.index("2 frames are clipped")
    assert page.text.index("2 frames are clipped") < page.text.index("Results")
    assert "No warnings." not in page.text


def test_what_people_type_stays_text(tmp_path: Path) -> None:
    evil = "<script>alert(1)</script>\"'&"
    report = decay_report(tmp_path, [patch(decay_series(name=evil)), patch(decay_series(name="b"))])
    about = replace(
        report.about, title=evil, rig=evil, run=evil, protocol_text=evil, sample=((evil, evil),)
    )
    text = written(tmp_path, replace(report, about=about), [evil])
    assert text.count("<script") == 1
    assert evil in Page(text).text


@pytest.mark.drawn
def test_the_same_report_gives_the_same_bytes(plain: Made, tmp_path: Path) -> None:
    assert written(tmp_path, plain.report) == plain.text
    for path in (plain.folder / "figures").iterdir():
        assert (tmp_path / "figures" / path.name).read_bytes() == path.read_bytes()


def test_what_a_run_has_besides_is_shown(plain: Made, tmp_path: Path) -> None:
    assert "simulated rig" not in plain.text
    for section in ("Notes", "What was cut off and done again", "Repeats"):
        assert f"{section}</h" not in plain.text
    series = decay_series()
    unit = ("decay-1",) * 15 + ("decay-2",) * 15
    page = Page(
        written(
            tmp_path,
            replace(
                plain.report,
                about=replace(
                    plain.report.about,
                    simulated=True,
                    notes="by hand\n## today\n\na <b>note</b>\n# as typed\n",
                    interruptions=(
                        Interruption("decay-2", "2026-01-01 00:40:00 UTC", "unplugged"),
                    ),
                ),
                patches=(patch(replace(series, unit=unit)),),
                charge_durations_s=(5400.0,),
            ),
        )
    )
    for expected in (
        "simulated rig",
        "today",
        "a <b>note</b>\n# as typed",
        "1 h 30 min",
        "unplugged",
        "decay-2",
        "Repeats",
    ):
        assert expected in page.text


def clipped_series() -> PatchReport:
    series = decay_series()
    return patch(replace(series, flag=("clipped",) * len(series.flag)))


def negative_series() -> PatchReport:
    series = decay_series()
    return patch(replace(series, values=series.values - [60.0, 20.0, 5.0]))


def noise_series() -> PatchReport:
    series = decay_series()
    values = np.random.default_rng(3).normal(-1.0, 0.5, series.values.shape)
    return PatchReport("noise", None, replace(series, values=values), "nothing but noise")


def unknown_sigma() -> PatchReport:
    series = decay_series()
    without = replace(series, sigma=np.full_like(series.sigma, np.nan))
    return PatchReport("table", None, without, patch(series).fit)


def single_time() -> PatchReport:
    return patch(decay_series(1))


def two_times() -> PatchReport:
    return patch(decay_series(2))


def monochrome() -> PatchReport:
    return patch(decay_series(channels=("L",)))


def channels_by_wavelength() -> PatchReport:
    return patch(decay_series(channels=("450 nm", "550 nm")))


@pytest.mark.parametrize(
    "make",
    [
        single_time,
        two_times,
        clipped_series,
        negative_series,
        noise_series,
        unknown_sigma,
        monochrome,
        channels_by_wavelength,
    ],
    ids=lambda make: make.__name__,
)
def test_odd_data_are_reported_all_the_same(
    tmp_path: Path, make: Callable[[], PatchReport]
) -> None:
    odd = make()
    page = Page(written(tmp_path, decay_report(tmp_path, [odd])))
    if isinstance(odd.fit, str):
        assert f"No fit: {odd.fit}" in page.text
    assert page.tags.count("svg") >= 3


def test_a_missing_fit_is_warned_of_once(tmp_path: Path) -> None:
    odd = clipped_series()
    page = Page(written(tmp_path, decay_report(tmp_path, [odd]), [f"not fitted: {odd.fit}"]))
    assert "1 warning" in page.text


def test_a_steady_source_is_reported_with_its_drift(tmp_path: Path) -> None:
    series = decay_series(name="my diode")
    flicker = 1 + 0.007 * np.random.default_rng(1).standard_normal((30, 1))
    lit = PatchReport("my diode", None, replace(series, values=400 * flicker * [0.3, 1, 0.5]), "no")
    page = Page(written(tmp_path, decay_report(tmp_path, [patch(series), lit])))
    assert "my diode, G" in page.text
    assert "--reference 'my diode'" in page.text
    assert "do not decay" not in Page(written(tmp_path, decay_report(tmp_path))).text


@pytest.mark.parametrize(("count", "folded"), [(4, 0), (5, 5)])
def test_many_patches_are_folded_up_behind_an_overview(
    tmp_path: Path, count: int, folded: int
) -> None:
    fitted = patch(decay_series(12))
    patches = [replace(fitted, name=f"paint {number}") for number in range(1, count + 1)]
    text = written(tmp_path, decay_report(tmp_path, patches))
    page = Page(text)
    for number in range(1, count + 1):
        assert page.references.count(f"#patch-{number}") >= 2
        assert f"patch-{number}" in page.ids
        assert page.text.count(f"paint {number}") >= 3
    assert text.count('class="patch folded"') == folded
    # A figure of every patch in the overview, five in its own section, and the timing.
    assert text.count('role="img"') == 6 * count + 1
    files = len(list((tmp_path / "figures").iterdir()))
    assert files == 5 * count + 1 + (0 if folded else count)


def test_a_warning_about_a_patch_of_several_stands_at_its_row(tmp_path: Path) -> None:
    fit = patch(decay_series()).fit
    assert isinstance(fit, DecayFit)
    clean = replace(patch(decay_series()), fit=replace(fit, warnings=()), name="a")
    warned = replace(clean, fit=replace(fit, warnings=as_warnings(["too hot"])), name="b")
    report = decay_report(tmp_path, [clean, warned])
    page = Page(written(tmp_path, report, ["b: too hot"]))
    assert page.text.count("1 warning") == 2
    assert page.text.count("too hot") == 2


def test_without_camera_curves_or_photographs(tmp_path: Path) -> None:
    report = replace(decay_report(tmp_path), camera=None, glow=(), daylight=(), frames=())
    page = Page(written(tmp_path, report))
    assert "img" not in page.tags
    assert "sensitivity is not known" in page.text


def test_unreadable_photographs_are_left_out(tmp_path: Path) -> None:
    report = decay_report(tmp_path)
    for one in report.frames:
        one.path.write_bytes(b"not a photograph")
    assert "img" not in Page(written(tmp_path, report)).tags


def test_a_full_disk_is_a_disk_error(tmp_path: Path) -> None:
    with pytest.raises(DiskError, match="cannot be written"):
        write_report(tmp_path / "none" / "report.html", page_of(decay_report(tmp_path)))
