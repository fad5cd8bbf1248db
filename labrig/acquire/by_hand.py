"""What a person does at the bench between two measurements."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ByHand:
    """One thing to do by hand.

    Attributes
    ----------
    what
        As one says it to a person: `put filter 37 in`.
    why
        What depends on it.
    takes_s
        For the plan.
    task
        The same for hands that are a device, a sample changer or the simulated room's: `filter 37`.
    """

    what: str
    why: str
    task: str
    takes_s: float = 60.0


class TakenBack(Exception):  # noqa: N818, a wish and no error
    """A person takes back what was done by hand last: its unit is done again."""
