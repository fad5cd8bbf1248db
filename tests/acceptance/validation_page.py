"""The page `docs/validation.md`, made of what the campaigns printed last."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.acceptance.campaigns import CAMPAIGNS, ROOT, Campaign, Output
from tests.acceptance.quoted_figures import QUOTES
from tests.acceptance.validation_figures import FIGURES

TEMPLATE = Path(__file__).with_name("validation.md")
PAGE = ROOT / "docs/validation.md"
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
