"""The pages `docs/validation`, made of what the campaigns printed last."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.acceptance.campaigns import CAMPAIGNS, ROOT, Campaign, Output
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.validation_areas import AREAS
from tests.acceptance.validation_figures import FIGURES

TEMPLATES = Path(__file__).with_name("validation_pages")
PAGES = ROOT / "docs/validation"
STALE_MARK = " †"


def pages() -> dict[Path, str]:
    """Return the text of each page of `docs/validation` by its path."""
    return {PAGES / f"{name}.md": page(name) for name in ("index", *AREAS)}


def page(name: str, *, marked: bool = False) -> str:
    """Return the text of a page of `docs/validation`.

    Parameters
    ----------
    name
        Name of an area, or `index`, which has no campaigns.
    marked
        Whether figures are marked whose code has changed since, as in the manual when it is built.
        The file itself has no marks, which would change with every commit.
    """
    campaigns = [CAMPAIGNS[campaign] for campaign in AREAS.get(name, ())]
    kept = {one.name: output for one in campaigns if (output := one.kept) is not None}
    missing = [one for one in campaigns if one.name not in kept]
    stale = {name for name in kept if CAMPAIGNS[name].stale} if marked else set()
    text = (TEMPLATES / f"{name}.md").read_text(encoding="utf-8")
    parts = {
        "figures": _rows(kept, stale),
        "not measured": _missing(missing),
        "outputs": _blocks(kept),
        "stale mark": [STALE_MARK.strip()],
    }
    for mark, lines in parts.items():
        text = text.replace(f"<!-- {mark} -->", "\n".join(lines))
    return text


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
    campaigns = list(campaigns)
    if campaigns:
        yield "## Not measured anew for this version\n"
    for campaign in campaigns:
        yield f"- `{campaign.command}`\n"
        for figure in FIGURES:
            if figure.campaign == campaign.name:
                yield f"  - {figure.what}"
        pages_that_quote = {quote.page for quote in QUOTES if quote.campaign == campaign.name}
        for quoting in sorted(page for page in pages_that_quote if page.startswith("docs/")):
            yield f"  - Figures of [](/{quoting.removeprefix('docs/')})"
        yield ""


def _blocks(kept: dict[str, Output]) -> Iterator[str]:
    for name, output in kept.items():
        yield f"({_anchor(name)})=\n### {name}\n"
        yield f"```sh\n{output.header['command']}\n```\n"
        yield f"<details><summary>printed on {output.date}</summary>\n"
        yield f"```text\n{output.text}```\n\n</details>\n"


def _anchor(name: str) -> str:
    return f"output-{name.replace('_', '-')}"
