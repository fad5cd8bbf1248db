"""A campaign's figures beside those that are published, and the pages that quote them."""

import re
from difflib import ndiff

from tests.acceptance.campaigns import ROOT, Campaign, Output
from tests.acceptance.printed import Extract
from tests.acceptance.quote import VALIDATION, Quote
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.validation_figures import FIGURES
from tests.acceptance.verdict import agrees


def says(quote: Quote, output: Output) -> bool:
    """Return whether a page quotes what the campaign printed."""
    text = (ROOT / quote.page).read_text(encoding="utf-8")
    return " ".join(quote.text(output.printed).split()) in " ".join(text.split())


def changes(campaign: Campaign, published: Output, measured: Output) -> list[str]:
    """Return what a campaign no longer shows of what is published, a line each."""
    texts: list[tuple[str, Extract]] = [
        (figure.what, figure.extract) for figure in FIGURES if figure.campaign == campaign.name
    ]
    texts += [(quote.page, quote.text) for quote in QUOTES if quote.campaign == campaign.name]
    changed = []
    for where, extract in texts:
        try:
            before, now = extract(published.printed), extract(measured.printed)
        except ValueError as error:
            changed.append(f"{where}: {error}")
            continue
        if not agrees(before, now, timed=campaign.timed):
            changed.append(f"{where}:\n{_difference(before, now)}")
    if (status := measured.header["exit status"]) != published.header["exit status"]:
        changed.append(f"exit status {status}")
    return changed


def _difference(published: str, measured: str) -> str:
    """Return the lines that differ, those published after "-" and those measured after "+"."""
    lines = ndiff(published.splitlines(), measured.splitlines())
    return "\n".join(f"    {line}" for line in lines if line[0] in "-+")


def renew_quotes(campaign: Campaign, published: Output, measured: Output) -> None:
    """Write the new figures and the new texts into the pages that quote them."""
    texts = [
        (f"{VALIDATION}/index.md", one.extract) for one in FIGURES if one.campaign == campaign.name
    ]
    texts += [(quote.page, quote.text) for quote in QUOTES if quote.campaign == campaign.name]
    for name, extract in texts:
        path = ROOT / name
        text = path.read_text(encoding="utf-8")
        try:
            path.write_text(
                renewed(text, extract(published.printed), extract(measured.printed)),
                encoding="utf-8",
            )
        except ValueError:
            print(f"  {name} has to be mended by hand", flush=True)


def renewed(page_text: str, before: str, now: str) -> str:
    """Return a page with a quotation replaced; words keep the page's line breaks.

    Raises
    ------
    ValueError
        The new quotation has other words, whose line breaks nobody knows.
    """
    new = now.split()

    def replace(quotation: re.Match[str]) -> str:
        old = re.split(r"(\s+)", quotation[0])
        if len(new) != len(old[::2]):
            raise ValueError("other words")
        old[::2] = new
        return "".join(old)

    return re.sub(r"\s+".join(map(re.escape, before.split())), replace, page_text)
