"""Table of figures that say how good labrig is, made of what its campaigns printed.

    python -m tests.acceptance.validation run [NAME ...]
    python -m tests.acceptance.validation turn [NUMBER]
    python -m tests.acceptance.validation stale
    python -m tests.acceptance.validation table
    python -m tests.acceptance.validation quotes

`run` runs campaigns, or all whose code has changed since they ran, keeps in `outputs/` what they
print, makes `docs/validation.md` of it and renews what README.md and other pages quote. `turn` runs
one part of the cheapest third, one part after another with the commits, and keeps nothing. Both
print the figures that are no longer what was published, and then end with exit status 1. `stale`
lists the campaigns whose code has changed; `table` makes the page anew; `quotes` prints what other
pages should quote and do not.
"""

import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from difflib import ndiff
from pathlib import Path

from tests.acceptance.campaigns import CAMPAIGNS, ROOT, Campaign, Output
from tests.acceptance.printed import Extract
from tests.acceptance.quote import Quote
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.validation_figures import FIGURES
from tests.acceptance.verdict import agrees

TEMPLATE = Path(__file__).with_name("validation.md")
PAGE = ROOT / "docs/validation.md"
#: Processor time of the campaigns that CI runs in one turn, and the fraction that takes turns.
TURN_CPU_S, CHEAP = 90.0, 1 / 3
STALE_MARK = " †"


def page(*, marked: bool = False) -> str:
    """Return the text of `docs/validation.md`.

    Parameters
    ----------
    marked
        Whether figures are marked whose code has changed since, as in the manual when it is built.
        The file itself has no marks, which would change with every commit.
    """
    kept = {name: output for name, one in CAMPAIGNS.items() if (output := one.kept) is not None}
    missing = [one for one in CAMPAIGNS.values() if one.name not in kept]
    stale = {name for name in kept if CAMPAIGNS[name].stale} if marked else set()
    return TEMPLATE.read_text(encoding="utf-8").format(
        table="\n".join(_rows(kept, stale)),
        missing="\n".join(_missing(missing)),
        outputs="\n".join(_blocks(kept)),
        stale_mark=STALE_MARK.strip(),
    )


def _rows(kept: dict[str, Output], stale: set[str]) -> Iterator[str]:
    yield "{.figures}"
    yield "| what | figure | measured |"
    yield "|---|---|---|"
    for figure in FIGURES:
        if figure.campaign in kept:
            output = kept[figure.campaign]
            title = figure.campaign.replace("_", " ")
            link = f"[{title}](#{_anchor(figure.campaign)})"
            mark = STALE_MARK if figure.campaign in stale else ""
            text = figure.extract(output.printed)
            yield f"| {figure.what} | {text} | {link} {output.date}, {_version(output)}{mark} |"


def _version(output: Output) -> str:
    """Return the version of labrig, and the digest of the sources where it was recorded."""
    return " ".join(output.header[key] for key in ("labrig", "code") if key in output.header)


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
        before = extract(published.printed)
        try:
            now = extract(measured.printed)
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


def turns() -> list[list[Campaign]]:
    """Return the parts into which the cheapest third of the campaigns is divided.

    What takes longer than a turn, and what has no recorded time, takes none.
    """
    cost_s = {one.name: one.kept.cpu_s for one in CAMPAIGNS.values() if one.kept is not None}
    known = sorted((s, name) for name, s in cost_s.items() if s is not None and s <= TURN_CPU_S)
    parts: list[list[Campaign]] = []
    left_s = 0.0
    for cpu_s, name in known[: round(CHEAP * len(CAMPAIGNS))]:
        if cpu_s > left_s or not parts:
            parts.append([])
            left_s = TURN_CPU_S
        parts[-1].append(CAMPAIGNS[name])
        left_s -= cpu_s
    return parts


def _turn_of_this_commit() -> int:
    counted = subprocess.run(
        ["git", "rev-list", "--count", "HEAD"], cwd=ROOT, capture_output=True, check=True
    )
    return int(counted.stdout)


def _run(campaigns: Iterable[Campaign], *, keep: bool) -> bool:
    """Run campaigns and return whether all that was published still holds."""
    hold = True
    for campaign in campaigns:
        published, measured = campaign.kept, campaign.run()
        changed = [] if published is None else changes(campaign, published, measured)
        status, cpu = measured.header["exit status"], measured.header["CPU time"]
        print(f"{campaign.name}: exit status {status}, {cpu} of processor time", flush=True)
        for one in changed:
            print(f"  no longer so: {one}", flush=True)
        if keep:
            campaign.keep(measured)
            if published is not None:
                _renew_quotes(campaign, published, measured)
        hold = hold and not changed
    if keep:
        PAGE.write_text(page(), encoding="utf-8")
    return hold


def _renew_quotes(campaign: Campaign, published: Output, measured: Output) -> None:
    """Write the new figures into README.md, and the new texts into the pages that quote them."""
    texts = [("README.md", one.extract) for one in FIGURES if one.campaign == campaign.name]
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


def _print_quotes() -> None:
    for quote in QUOTES:
        output = CAMPAIGNS[quote.campaign].kept
        if output is not None and not says(quote, output):
            print(f"{quote.page}, {quote.campaign}:\n{quote.text(output.printed)}\n")


def main(arguments: list[str]) -> None:
    """Run campaigns, or write the page."""
    stale = [one for one in CAMPAIGNS.values() if one.stale]
    match arguments:
        case ["run", *names] if set(names) <= CAMPAIGNS.keys():
            wanted = [CAMPAIGNS[name] for name in names] or stale
            sys.exit(not _run(wanted, keep=True))
        case ["turn", *number] if len(number) <= 1 and "".join([*number, "1"]).isdecimal():
            parts = turns()
            count = int(number[0]) if number else _turn_of_this_commit()
            sys.exit(not _run(parts[count % len(parts)], keep=False) if parts else 0)
        case ["stale"]:
            for one in stale:
                print(one.name, one.kept.date if one.kept else "never", sep="  ")
        case ["table"]:
            PAGE.write_text(page(), encoding="utf-8")
        case ["quotes"]:
            _print_quotes()
        case _:
            print(__doc__, "Campaigns:", *CAMPAIGNS, sep="\n")
            sys.exit(2)


if __name__ == "__main__":
    main(sys.argv[1:])
