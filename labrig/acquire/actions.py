"""What a protocol's unit can have done, and when in a sequence."""

from dataclasses import dataclass

from labrig.acquire.roles import DeviceAction, Shoot
from labrig.quantity import duration_text


@dataclass(frozen=True)
class ManualStep:
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
        The same for a changer, a sample changer or the simulated room's: `filter 37`.
    """

    what: str
    why: str
    task: str
    takes_s: float = 60.0


class UndoManualStep(Exception):  # noqa: N818, a wish and no error
    """A person takes back what was done by hand last: its unit is done again."""


Action = DeviceAction | Shoot


@dataclass(frozen=True)
class TimedAction:
    """An action and when it begins, in seconds after the start of its sequence."""

    at_s: float
    action: Action


def at(at_s: float, action: Action) -> TimedAction:
    """Schedule an action within a sequence.

    Parameters
    ----------
    at_s
        Begin of the action in seconds after the start of the sequence.
    action
        Action of a device, or photograph.

    Returns
    -------
    TimedAction
        Action with its time, for `Session.run_sequence`.

    Examples
    --------
    >>> from labrig.acquire import LAMP_OFF, LAMP_ON, at
    >>> flash = [at(0.0, LAMP_ON), at(2.0, LAMP_OFF)]
    >>> [(timed.at_s, str(timed.action)) for timed in flash]
    [(0.0, 'on'), (2.0, 'off')]
    """
    return TimedAction(at_s, action)


@dataclass(frozen=True)
class LateAction:
    """An action that began later than its tolerance allows."""

    timed: TimedAction
    late_s: float

    def __str__(self) -> str:
        action = self.timed.action
        what = str(action) if isinstance(action, Shoot) else f"{action.device} {action}"
        return f"{what} by {duration_text(self.late_s)}"
