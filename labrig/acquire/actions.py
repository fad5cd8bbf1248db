"""Actions of a protocol's units and their times in a sequence."""

from dataclasses import dataclass

from labrig.acquire.roles import DeviceAction, ReadSpectrum, TakeFrame
from labrig.foundation.quantity import duration_text


@dataclass(frozen=True)
class ManualStep:
    """One step to be done by hand.

    Attributes
    ----------
    what
        Instruction to the person, such as `put filter 37 in`.
    why
        Reason for the step.
    task
        Command for a changer that replaces the person, such as `filter 37`.
    takes_s
        Duration in seconds that is assumed in the plan.
    """

    what: str
    why: str
    task: str
    takes_s: float = 60.0


class UndoManualStep(Exception):  # noqa: N818, a wish and no error
    """Request of a person to undo the last step done by hand and to do its unit again."""


Action = DeviceAction | TakeFrame | ReadSpectrum


@dataclass(frozen=True)
class TimedAction:
    """An action with its time in a sequence.

    Attributes
    ----------
    at_s
        Start of the action in seconds after the start of the sequence.
    action
        Action of a device, photograph, or reading of a spectrum.
    """

    at_s: float
    action: Action


def at(at_s: float, action: Action) -> TimedAction:
    """Schedule an action within a sequence.

    Parameters
    ----------
    at_s
        Start of the action in seconds after the start of the sequence.
    action
        Action of a device, photograph, or reading of a spectrum.

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
    """An action that began later than its tolerance allows.

    Attributes
    ----------
    timed
        The action with its planned time.
    late_s
        Delay in seconds.
    """

    timed: TimedAction
    late_s: float

    def __str__(self) -> str:
        action = self.timed.action
        what = str(action) if isinstance(action, TakeFrame) else f"{action.device} {action}"
        return f"{what} by {duration_text(self.late_s)}"
