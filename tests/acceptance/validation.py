"""Table of figures that say how good labrig is, made of what its campaigns printed.

    python -m tests.acceptance.validation run [NAME ...]
    python -m tests.acceptance.validation turn [NUMBER]
    python -m tests.acceptance.validation stale
    python -m tests.acceptance.validation table
    python -m tests.acceptance.validation quotes

`run` runs campaigns, or all whose code has changed since they ran, keeps in `outputs/` what they
print, makes the pages of `docs/validation` of it and renews what other pages quote. `turn` runs one
part of the cheapest third, one part after another with the commits, and keeps nothing. Both print
the figures that are no longer what was published, and then end with exit status 1. `stale` lists
the campaigns whose code has changed; `table` makes the pages anew; `quotes` prints what other pages
should quote and do not.
"""

import subprocess
import sys
from collections.abc import Iterable

from tests.acceptance.campaigns import CAMPAIGNS, ROOT, Campaign
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.renewal import changes, renew_quotes, says
from tests.acceptance.validation_page import pages

#: Processor time of the campaigns that CI runs in one turn, and the fraction that takes turns.
TURN_CPU_S, CHEAP = 90.0, 1 / 3


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
                renew_quotes(campaign, published, measured)
        hold = hold and not changed
    if keep:
        _write_pages()
    return hold


def _write_pages() -> None:
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")


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
            _write_pages()
        case ["quotes"]:
            _print_quotes()
        case _:
            print(__doc__, "Campaigns:", *CAMPAIGNS, sep="\n")
            sys.exit(2)


if __name__ == "__main__":
    main(sys.argv[1:])
