"""The pages docs/validation are what their script makes of what the campaigns printed."""

import re

import pytest

from tests.acceptance.campaigns import CAMPAIGNS, OUTPUTS, ROOT, Output
from tests.acceptance.quote import Quote
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.renewal import changes, renewed, says
from tests.acceptance.sources import digest
from tests.acceptance.validation import TURN_CPU_S, turns
from tests.acceptance.validation_areas import all_names
from tests.acceptance.validation_figures import FIGURES, Figure
from tests.acceptance.validation_page import PAGES, TEMPLATES, pages
from tests.acceptance.verdict import agrees

KEPT = {name: output for name, one in CAMPAIGNS.items() if (output := one.kept) is not None}


def test_the_pages_are_made_of_what_is_kept() -> None:
    made = pages()
    assert set(PAGES.iterdir()) == made.keys()
    assert {path for path in made if path.read_text(encoding="utf-8") != made[path]} == set()


def test_each_campaign_has_one_area() -> None:
    assert sorted(all_names()) == sorted(CAMPAIGNS)


def test_the_first_page_has_figures_of_the_others() -> None:
    index = (TEMPLATES / "index.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| .* \| (.*) \| .* \|$", index, re.M)
    extracted = {one.extract(KEPT[one.campaign].printed) for one in FIGURES if one.campaign in KEPT}
    assert len(rows) > 5
    assert set(rows[1:]) <= extracted


USER_PAGES = [
    *("README.md", "docs/tutorial.md", "docs/index.md"),
    *(f"docs/{kind}/*.md" for kind in ("how-to", "explanation")),
]


def test_pages_for_users_name_no_test_commands() -> None:
    """Figures of tests, and how to repeat them, stand on the pages of the validation."""
    named = [
        f"{path.name}: {match[0]}"
        for pattern in USER_PAGES
        for path in ROOT.glob(pattern)
        for match in re.finditer(
            r"tests\.acceptance|\btests/\w+/\w+\.py|pytest [-\w]|\b\d+ seeds",
            path.read_text("utf-8"),
        )
    ]
    assert named == []


def test_what_is_kept_belongs_to_a_campaign_and_says_how_it_was_made() -> None:
    assert {path.stem for path in OUTPUTS.iterdir()} == KEPT.keys()
    for output in KEPT.values():
        assert set(output.header) >= {"command", "labrig", "date", "exit status"}


def test_a_figure_without_a_digest_of_its_code_is_stale() -> None:
    for name, output in KEPT.items():
        assert "code" in output.header or CAMPAIGNS[name].stale


def test_the_cheapest_third_takes_turns_of_no_more_than_a_turn() -> None:
    parts = turns()
    assert len(parts) > 1
    assert sum(map(len, parts)) <= len(CAMPAIGNS) / 3 + 1
    for campaigns in parts:
        assert sum(KEPT[one.name].cpu_s or 0 for one in campaigns) <= TURN_CPU_S


@pytest.mark.parametrize(
    ("published", "measured", "still"),
    [
        ("64 to 74 % within 1 σ", "66 to 73 % within 1 σ", True),
        ("k_e within 5.0 % and 1.9 σ", "k_e within 5.0 % and 2.3 σ", False),
        ("0 of 600 wrong", "1 of 600 wrong", False),
        ("bias −0.18 σ", "bias −0.19 σ", True),
        ("bias −0.18 σ", "bias 0.18 σ", False),
        ("1.2e-6", "1.3e-6", True),
        ("1.2e-6", "1.2e-5", False),
        ("right in 12 of 12", "right in 12 of 12, warned", False),
    ],
)
def test_a_figure_still_holds_where_its_numbers_move_little(
    published: str, measured: str, still: bool
) -> None:
    assert agrees(published, measured) == still


def test_durations_are_no_verdict() -> None:
    assert agrees("off after 1.2 s", "off after 7.9 s", timed=True)


def test_what_an_output_no_longer_shows_is_named() -> None:
    published = KEPT["reference_data"]
    header = {**published.header, "exit status": "1"}
    assert changes(CAMPAIGNS["reference_data"], published, published) == []
    changed = changes(CAMPAIGNS["reference_data"], published, Output(header, "nothing"))
    figures = [one for one in FIGURES if one.campaign == "reference_data"]
    quotes = [one for one in QUOTES if one.campaign == "reference_data"]
    assert len(changed) == len(figures) + len(quotes) + 1


def test_a_quotation_is_renewed_where_the_page_breaks_its_lines() -> None:
    page_text = "It takes 12 ms\nof 30 ms, as 12 of 30 show."
    assert renewed(page_text, "12 ms of 30 ms", "14 ms of 31 ms") == (
        "It takes 14 ms\nof 31 ms, as 12 of 30 show."
    )
    with pytest.raises(ValueError, match="other words"):
        renewed(page_text, "12 ms of 30 ms", "no time")


def test_a_digest_is_of_the_sources_that_a_module_reaches() -> None:
    assert digest("labrig.foundation.errors") != digest("labrig.foundation.clock")
    assert digest("tests.acceptance.labrig_process") == digest("tests.acceptance.labrig_process")


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
