"""Pose of the sample: trap door and lamp shield, on benches that have them.

Without a door the sample faces lamp and camera at once, and nothing has to be moved.
"""

from collections.abc import Sequence

from labrig.acquire import (
    DOOR,
    DOOR_CLOSE,
    DOOR_OPEN,
    LAMP_OFF,
    LAMP_ON,
    SHIELD,
    SHIELD_COVER,
    SHIELD_UNCOVER,
    LampSwitch,
    LedSwitch,
    Rig,
    Session,
    TimedAction,
    at,
)
from labrig.foundation.errors import ProtocolError
from labrig.foundation.quantity import duration_text

#: Time until a halogen lamp is dark (Nalbach et al., section 4.6); a shield is faster.
LAMP_DARK_S = 0.32
#: Time for the servo's next frame and the ringing of the door.
SETTLES_S = 0.1


def has_door(session: Session) -> bool:
    """Return whether the sample turns from lamp to camera."""
    return DOOR in session.rig


def face_camera(session: Session) -> None:
    """Turn the sample to the camera, away from the lamp; wait until the door has stopped."""
    if has_door(session):
        session.perform(DOOR_OPEN)
        session.wait(session.rig[DOOR].travel_s() + SETTLES_S, "door opens")


def face_lamp(session: Session) -> None:
    """Turn the sample to the lamp, uncovered; wait until the doors have stopped."""
    travels_s = []
    if SHIELD in session.rig:
        session.perform(SHIELD_UNCOVER)
        travels_s.append(session.rig[SHIELD].travel_s())
    if has_door(session):
        session.perform(DOOR_CLOSE)
        travels_s.append(session.rig[DOOR].travel_s())
    if travels_s:
        session.wait(max(travels_s) + SETTLES_S, "door and shield move")


def charge(session: Session, duration_s: float, on: LampSwitch | LedSwitch = LAMP_ON) -> None:
    """Turn the sample to the lamp and light it for that long, by default by the lamp."""
    face_lamp(session)
    session.perform(on)
    session.wait(duration_s, "charging")


def lights_out(session: Session, off: LampSwitch | LedSwitch = LAMP_OFF) -> Sequence[TimedAction]:
    """Return the start of a timed sequence: lamp off, shield before it, then the door opens."""
    steps = [at(0.0, off)]
    if SHIELD in session.rig:
        steps.append(at(0.0, SHIELD_COVER))
    if has_door(session):
        steps.append(at(_door_opens_s(session.rig), DOOR_OPEN))
    return steps


def _door_opens_s(rig: Rig) -> float:
    """Return the time from lamp off until no light of the lamp reaches the sample, in seconds."""
    if SHIELD not in rig:
        return LAMP_DARK_S
    return min(LAMP_DARK_S, rig[SHIELD].travel_s() + SETTLES_S)


def visible_after_s(rig: Rig) -> float:
    """Return the time from `lights_out` until the camera sees the whole sample, in seconds."""
    if DOOR not in rig:
        return 0.0
    return _door_opens_s(rig) + rig[DOOR].travel_s() + SETTLES_S


def check_visible(session: Session, first_s: float) -> None:
    """Refuse a first photograph before the door is open.

    Raises
    ------
    ProtocolError
        The first photograph is too early; the message has the earliest time.
    """
    visible_s = visible_after_s(session.rig)
    if first_s < visible_s:
        raise ProtocolError(
            f"the first frame {duration_text(first_s)} after lamp off would show a door that still "
            f"moves; it is open {duration_text(visible_s)} after lamp off, so write "
            f"first: {duration_text(round(visible_s + 0.05, 1))}"
        )
