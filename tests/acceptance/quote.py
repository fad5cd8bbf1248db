"""What a page of the manual says of a campaign's output."""

from dataclasses import dataclass

from tests.acceptance.printed import Extract

EXPLANATION, HOW_TO, DECISIONS = "docs/explanation", "docs/how-to", "docs/decisions"


@dataclass(frozen=True)
class Quote:
    """Text that a page has to contain, but for its line breaks.

    Attributes
    ----------
    page
        File, from the root of the repository.
    text
        Function that makes the text of the campaign's output.
    """

    page: str
    campaign: str
    text: Extract
