"""docs/validation.md is what its script makes of what the campaigns printed."""

import re

import pytest

from tests.acceptance.campaigns import CAMPAIGNS, OUTPUTS, ROOT
from tests.acceptance.quote import Quote
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.validation import PAGE, page, says
from tests.acceptance.validation_figures import FIGURES, Figure

KEPT = {name: output for name, one in CAMPAIGNS.items() if (output := one.kept) is not None}


def test_the_page_is_made_of_what_is_kept() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


def test_the_readme_tells_figures_of_the_page() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    section = readme.split("## How good is it")[1].split("\n## ")[0]
    told = [
        row.split(" | ")[1].removesuffix(" |") for row in re.findall(r"^\|.* \|$", section, re.M)
    ]
    found = {one.extract(KEPT[one.campaign].printed) for one in FIGURES if one.campaign in KEPT}
    assert len(told) > 5
    assert set(told[1:]) <= found


def test_what_is_kept_belongs_to_a_campaign_and_says_how_it_was_made() -> None:
    assert {path.stem for path in OUTPUTS.iterdir()} == KEPT.keys()
    for output in KEPT.values():
        assert list(output.header) == ["command", "labrig", "date", "exit status"]


@pytest.mark.parametrize("figure", [one for one in FIGURES if one.campaign in KEPT])
def test_a_figure_is_found(figure: Figure) -> None:
    assert re.search(r"\d", figure.extract(KEPT[figure.campaign].printed))


@pytest.mark.parametrize(
    "quote",
    [one for one in QUOTES if one.campaign in KEPT],
    ids=lambda one: f"{one.page}-{one.campaign}",
)
def test_a_page_says_what_was_printed(quote: Quote) -> None:
    output = KEPT[quote.campaign]
    assert quote.text(output.printed)
    assert says(quote, output), f"{quote.page} should say\n{quote.text(output.printed)}"


def test_every_campaign_has_figures() -> None:
    used = {figure.campaign for figure in FIGURES} | {quote.campaign for quote in QUOTES}
    assert used == CAMPAIGNS.keys()


@pytest.mark.parametrize("name", KEPT)
def test_no_output_has_an_absolute_path(name: str) -> None:
    text = CAMPAIGNS[name].path.read_text(encoding="utf-8")
    assert not re.search(r"(?<![\w.:/])/\w[\w.-]*/|\b[A-Z]:\\", text)
