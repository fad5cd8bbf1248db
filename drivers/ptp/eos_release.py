"""The release button of an EOS: two stages, or one on older cameras."""

from abc import ABC, abstractmethod
from enum import Enum, auto

from .device_info import DeviceInfo
from .eos_protocol import Eos
from .failures import RefusedError
from .ptp_codes import DEVICE_BUSY
from .session import Patience, Reply, Session

HALF, FULL = 1, 2
#: A slow lens keeps a 5D Mark II from answering for 8 s (libgphoto2).
FOCUS_S = 12.0
#: Busy at the full press is common; a frame later than so much belongs to no decay.
LATE_PRESS_S = 3.0

_RESULTS = {
    1: "it found no focus: set the lens to manual focus (MF)",
    3: "its mirror is locked up: switch mirror lock-up off",
    7: "it believes there is no room for the frame: start again",
}


class Stage(Enum):
    """Where a stage of the button is, as far as is known."""

    UP = auto()
    #: A command was sent, and not answered with OK.
    UNKNOWN = auto()
    DOWN = auto()


class Release(ABC):
    """Presses and lets go, and can let go after anything."""

    def __init__(self, session: Session) -> None:
        self._session = session

    @abstractmethod
    def press_half(self) -> None:
        """Have the camera get ready."""

    @abstractmethod
    def press_full(self, exposure_s: float) -> Reply:
        """Begin an exposure of `exposure_s` seconds; the reply tells when.

        Raises
        ------
        RefusedError
            No exposure has begun.
        DeviceError
            Nobody knows whether one has.
        """

    @abstractmethod
    def let_go_full(self, busy_s: float) -> None:
        """Let go of the second stage; a camera that still exposes may be busy for `busy_s`."""

    @abstractmethod
    def let_go_half(self, busy_s: float) -> None:
        """Let go of the first stage."""

    @abstractmethod
    def let_go_blindly(self) -> None:
        """Let go of what another program, or this one before a reset, may have held."""


class TwoStageRelease(Release):
    """RemoteReleaseOn and Off: the first stage can be held, the second acts at once."""

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self._stages = {HALF: Stage.UP, FULL: Stage.UP}

    def press_half(self) -> None:
        if self._stages[HALF] is not Stage.DOWN:
            self._press(HALF, Patience(answer_s=FOCUS_S, busy_s=LATE_PRESS_S))

    def press_full(self, exposure_s: float) -> Reply:
        # some cameras answer when the shutter has closed
        return self._press(FULL, Patience(answer_s=exposure_s + FOCUS_S, busy_s=LATE_PRESS_S))

    def let_go_full(self, busy_s: float) -> None:
        self._let_go(FULL, busy_s)

    def let_go_half(self, busy_s: float) -> None:
        self._let_go(HALF, busy_s)

    def let_go_blindly(self) -> None:
        self._stages = {HALF: Stage.UNKNOWN, FULL: Stage.UNKNOWN}
        self._let_go(FULL, LATE_PRESS_S)
        self._let_go(HALF, LATE_PRESS_S)

    def _press(self, stage: int, patience: Patience) -> Reply:
        self._stages[stage] = Stage.UNKNOWN
        reply = self._session.transact(Eos.RemoteReleaseOn, stage, 0, patience=patience)
        self._stages[stage] = Stage.DOWN
        return reply

    def _let_go(self, stage: int, busy_s: float) -> None:
        before = self._stages[stage]
        if before is Stage.UP:
            return
        self._stages[stage] = Stage.UNKNOWN
        patience = Patience(answer_s=FOCUS_S, busy_s=busy_s)
        try:
            self._session.transact(Eos.RemoteReleaseOff, stage, patience=patience)
        except RefusedError as refusal:
            # a camera may refuse to let go of what is not down
            if before is Stage.DOWN or refusal.code == DEVICE_BUSY:
                self._stages[stage] = before
                raise
        self._stages[stage] = Stage.UP


class OneStageRelease(Release):
    """RemoteRelease: presses and lets go by itself."""

    def press_half(self) -> None:
        pass

    def press_full(self, exposure_s: float) -> Reply:
        patience = Patience(answer_s=exposure_s + FOCUS_S, busy_s=LATE_PRESS_S)
        reply = self._session.transact(Eos.RemoteRelease, patience=patience)
        result = reply.params[0] if reply.params else 0
        if result != 0:
            remedy = _RESULTS.get(result, "leave its menus and try again")
            raise RefusedError(
                f"expected the camera to release, it answered {result} to RemoteRelease 0x910F: "
                f"{remedy}",
                result,
            )
        return reply

    def let_go_full(self, busy_s: float) -> None:
        pass

    def let_go_half(self, busy_s: float) -> None:
        pass

    def let_go_blindly(self) -> None:
        pass


def release_of(info: DeviceInfo, session: Session) -> Release:
    """The release that a camera has."""
    two_stages = {Eos.RemoteReleaseOn, Eos.RemoteReleaseOff} <= info.operations
    return TwoStageRelease(session) if two_stages else OneStageRelease(session)
