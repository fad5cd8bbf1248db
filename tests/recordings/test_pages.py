"""Reports of recorded runs as a person reads them, on a telephone as well."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from .runs import RUNS, Recorded

pytestmark = pytest.mark.drawn

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

#: Reports of every run of the tests; those of the others take a second to draw for each figure.
AT_ONCE = {"blank", "decay", "patches"}
PHONE = {"width": 390, "height": 900, "deviceScaleFactor": 1, "mobile": True}
#: Script that lists what a reader cannot read, and what nobody should have to.
UNREADABLE = (Path(__file__).parent / "unreadable.js").read_text(encoding="utf-8")


def unreadable(chromium: "Chrome", page: Path) -> list[str]:
    """Faults that the script lists on a page that is shown on a telephone."""
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    chromium.get(page.as_uri())
    found: list[str] = chromium.execute_script(UNREADABLE)
    return found


@pytest.mark.parametrize(
    "run",
    [
        pytest.param(
            run,
            id=run.name,
            marks=() if run.name in AT_ONCE else pytest.mark.campaign,
        )
        for run in RUNS
    ],
)
def test_a_report_is_readable_on_a_telephone(
    run: Recorded, chromium: "Chrome", tmp_path: Path
) -> None:
    result = run.processed(tmp_path)
    assert not unreadable(chromium, result / "report.html")


PLANTED = """<!DOCTYPE html><meta name="viewport" content="width=device-width"><body>
<p style="white-space:nowrap">{long}</p>
<p>43% at 2e-05 of -1.5, (1 + t)^p, <a href="#nowhere">there</a></p>
<table><thead><tr><th>Patch</th><th>Wavelength</th></tr></thead>
<tbody><tr><th>card</th><td class="number">451 ± 2</td></tr></tbody></table>
<svg viewBox="0 0 200 100" aria-label="chart">
<text x="10" y="50">8</text><text x="11" y="50">8.1</text>
<text x="90" y="20">k_e</text>
<g class="legend"><g><path style="fill:red" d="M1 2h3"/><text x="20" y="90">R</text></g>
<g><path style="fill:red" d="M9 2h3"/><text x="60" y="90">B</text></g></g></svg>
"""


def test_all_that_is_looked_for_is_noticed(chromium: "Chrome", tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(PLANTED.format(long="long " * 40), encoding="utf-8")
    kinds = {text.partition(":")[0] for text in unreadable(chromium, page)}
    assert kinds == {
        "beyond the window", "overlap", "exponent", "caret", "percent", "hyphen", "underscore",
        "dead link", "same in the legend", "no unit",
    }  # fmt: skip
