"""Table of figures that say how good labrig is, made of what its campaigns printed.

    python -m tests.acceptance.validation run NAME ...
    python -m tests.acceptance.validation table
    python -m tests.acceptance.validation quotes

`run` keeps in `outputs/` what campaigns print; `table` makes `docs/validation.md` of what is kept;
`quotes` prints what other pages should say of it and do not.
"""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.acceptance.campaigns import CAMPAIGNS, ROOT, Campaign, Output
from tests.acceptance.quote import Quote
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.validation_figures import FIGURES

TEMPLATE = Path(__file__).with_name("validation.md")
PAGE = ROOT / "docs/validation.md"


def page() -> str:
    """`docs/validation.md`."""
    kept = {name: output for name, one in CAMPAIGNS.items() if (output := one.kept) is not None}
    missing = [one for one in CAMPAIGNS.values() if one.name not in kept]
    return TEMPLATE.read_text(encoding="utf-8").format(
        table="\n".join(_rows(kept)),
        missing="\n".join(_missing(missing)),
        outputs="\n".join(_blocks(kept)),
    )


def _rows(kept: dict[str, Output]) -> Iterator[str]:
    yield "{.figures}"
    yield "| what | figure | measured |"
    yield "|---|---|---|"
    for figure in FIGURES:
        if figure.campaign in kept:
            output = kept[figure.campaign]
            title = figure.campaign.replace("_", " ")
            link = f"[{title}](#{_anchor(figure.campaign)})"
            found = figure.extract(output.printed)
            yield f"| {figure.what} | {found} | {link} {output.header['date']} |"


def _missing(campaigns: Iterable[Campaign]) -> Iterator[str]:
    for campaign in campaigns:
        yield f"- `{campaign.command}`\n"
        for figure in FIGURES:
            if figure.campaign == campaign.name:
                yield f"  - {figure.what}"
        for quoting in sorted({quote.page for quote in QUOTES if quote.campaign == campaign.name}):
            yield f"  - Figures of [](/{quoting.removeprefix('docs/')})"
        yield ""


def _blocks(kept: dict[str, Output]) -> Iterator[str]:
    for name, output in kept.items():
        command = f"```sh\n{output.header['command']}\n```"
        yield f"({_anchor(name)})=\n### {name}\n\n{command}\n\n```text\n{output.text}```\n"


def _anchor(name: str) -> str:
    return f"output-{name.replace('_', '-')}"


def says(quote: Quote, output: Output) -> bool:
    """Whether a page says what the campaign printed."""
    text = (ROOT / quote.page).read_text(encoding="utf-8")
    return " ".join(quote.text(output.printed).split()) in " ".join(text.split())


def _print_quotes() -> None:
    for quote in QUOTES:
        output = CAMPAIGNS[quote.campaign].kept
        if output is not None and not says(quote, output):
            print(f"{quote.page}, {quote.campaign}:\n{quote.text(output.printed)}\n")


def main(arguments: list[str]) -> None:
    """Run campaigns, or write the page."""
    match arguments:
        case ["run", *names] if names and set(names) <= CAMPAIGNS.keys():
            for name in names:
                print(f"{name}: exit status {CAMPAIGNS[name].run()}", flush=True)
        case ["table"]:
            PAGE.write_text(page(), encoding="utf-8")
        case ["quotes"]:
            _print_quotes()
        case _:
            print(__doc__, "Campaigns:", *CAMPAIGNS, sep="\n")
            sys.exit(2)


if __name__ == "__main__":
    main(sys.argv[1:])
