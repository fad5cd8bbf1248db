"""The page as people see it: on a desktop, a tablet and a phone, in the dark and on paper."""

import base64
import re
import zlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from labrig.fit import fit_mixture
from labrig.material import with_sigma
from labrig.optics import read_light
from labrig.process import report_mixture
from labrig.record.history import Interruption
from labrig.report import FittedMatrix, Report, write_report
from labrig.report.report_model import PatchReport
from tests.material.reradiation.synthetic import YELLOW, measurement

from .made import decay_report, decay_series, page_of, patch

pytestmark = pytest.mark.drawn

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

WIDTHS = (1280, 800, 390)
#: Elements that reach beyond the window and are in nothing that scrolls.
BEYOND = """
const width = document.documentElement.clientWidth;
return [...document.querySelectorAll("body *")]
  .filter(element => !element.closest(".scroll") && !element.closest("svg"))
  .filter(element => element.getBoundingClientRect().right > width + 0.5)
  .map(element => element.outerHTML.slice(0, 80));
"""
TICK_COLOUR = """
const tick = document.querySelector('.plot svg text');
return getComputedStyle(tick).fill;
"""


def crowded(folder: Path) -> Report:
    """Long words, a failed fit, repeats, warnings, notes."""
    series = decay_series(name="a patch-with-a-very-long-name-that-is-not-to-be-broken-anywhere")
    unit = tuple(np.where(np.arange(30) % 2, "decay-2", "decay-1"))
    failed = PatchReport("nothing", None, decay_series(seed=2, name="nothing"), "nothing glows")
    report = decay_report(folder, [patch(replace(series, unit=unit)), failed])
    about = replace(
        report.about,
        title="sample_" * 12,
        notes="## today\n\n" + "noted" * 60,
        interruptions=(Interruption("decay-2", "2026-01-01 00:40:00 UTC", "lost " + "it" * 70),),
    )
    return page_of(replace(report, about=about), ["warned/of/" + "something/" * 20])


def test_nothing_overflows_and_no_printed_page_is_blank(chromium: "Chrome", tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    write_report(page, crowded(tmp_path))
    for width in WIDTHS:
        metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        chromium.get(page.as_uri())
        chromium.execute_script(
            "document.querySelectorAll('details').forEach(one => { one.open = true; })"
        )
        assert chromium.execute_script(BEYOND) == [], width
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    assert chromium.execute_script(TICK_COLOUR) == "rgb(95, 107, 118)"
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    assert chromium.execute_script(TICK_COLOUR) == "rgb(152, 164, 174)"

    button = chromium.find_element("css selector", ".copy")
    button.click()
    chromium.execute_async_script("setTimeout(arguments[0], 200)")
    assert button.text.startswith(("Copied", "Selected"))

    chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    chromium.get(page.as_uri())
    printed = chromium.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
    pages = shown_texts(base64.b64decode(printed["data"]))
    assert 0 not in pages
    # Results and sample, a page for each patch, the rest.
    assert 5 <= len(pages) <= 7


@pytest.mark.campaign
def test_a_mixture_overflows_nowhere(chromium: "Chrome", tmp_path: Path) -> None:
    matrix = replace(with_sigma(measurement(21, YELLOW).measured), name="paper_" * 20)
    lights = tuple(read_light(name) for name in ("D65", "A", "450nm", "395nm", "FL2"))
    fitted = FittedMatrix(matrix, fit_mixture(matrix), lights)
    (tmp_path / "paper.csv").touch()
    command = f"labrig fit mixture {'a/folder/' * 20}paper.csv"
    page = report_mixture(tmp_path / "paper.csv", fitted, command, tmp_path)
    for width in WIDTHS:
        metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
        chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        chromium.get(page.as_uri())
        assert chromium.execute_script(BEYOND) == [], width
    chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    printed = chromium.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
    assert 0 not in shown_texts(base64.b64decode(printed["data"]))


def test_a_link_opens_the_patch_that_it_names(chromium: "Chrome", tmp_path: Path) -> None:
    fitted = patch(decay_series(12))
    patches = [replace(fitted, name=f"paint {number}") for number in range(1, 6)]
    page = tmp_path / "report.html"
    write_report(page, page_of(decay_report(tmp_path, patches)))

    def opened() -> list[str]:
        return [
            summary.text.split()[-1]
            for summary in chromium.find_elements("css selector", ".folded > details[open] summary")
            if summary.text.startswith(tuple("12345"))
        ]

    chromium.get(page.as_uri())
    assert opened() == []
    chromium.find_element("css selector", ".tiles a[href='#patch-2']").click()
    assert opened() == ["2"]
    chromium.find_element("css selector", ".summary a[href='#patch-4']").click()
    assert opened() == ["2", "4"]
    (figure, *_) = chromium.find_elements("css selector", "#patch-4 .plot > svg")
    assert figure.rect["width"] > 300
    chromium.find_element("css selector", ".open-all").click()
    assert opened() == ["1", "2", "3", "4", "5"]


def shown_texts(pdf: bytes) -> list[int]:
    """How many pieces of text each page of a PDF by Chromium shows."""
    found = re.findall(rb"^(\d+) 0 obj\s(.*?)\sendobj", pdf, re.DOTALL | re.MULTILINE)
    objects = {int(number): body for number, body in found}
    pages = [body for body in objects.values() if re.search(rb"/Type /Page\b", body)]
    counts = []
    for page in pages:
        contents = re.search(rb"/Contents (\d+) 0 R", page)
        assert contents
        about, _, stream = objects[int(contents[1])].partition(b"stream\n")
        if b"/FlateDecode" in about:
            stream = zlib.decompressobj().decompress(stream)
        counts.append(len(re.findall(rb"T[jJ]\b", stream)))
    return counts
