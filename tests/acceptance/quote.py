"""Text of a page of the manual that a campaign's output determines."""

from dataclasses import dataclass

from tests.acceptance.printed import Extract

EXPLANATION, HOW_TO, DECISIONS = "docs/explanation", "docs/how-to", "docs/decisions"
#: Texts of `docs/validation`, into which figures and outputs are filled.
VALIDATION = "tests/acceptance/validation_pages"


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
