"""Devices that note what they are told, for tests of what happens around them."""

from collections.abc import Callable

from labrig.acquire import CameraCapabilities, ExposureSettings, Frame, ManualStep
from labrig.foundation.clock import VirtualClock
from labrig.record import FrameRecord

Note = Callable[[str], None]


class NotingLamp:
    """A lamp; fails on demand."""

    def __init__(self, clock: VirtualClock, note: Note, fail: Exception | None = None) -> None:
        self.channel_on = False
        self.fail = fail
        self._clock = clock
        self._note = note

    def identity(self) -> str:
        return "noting lamp"

    def on(self) -> None:
        self._clock.sleep(0.001)
        if self.fail:
            raise self.fail
        self.channel_on = True
        self._note("lamp on")

    def off(self) -> None:
        self._clock.sleep(0.001)
        self.channel_on = False
        self._note("lamp off")

    def reads_back(self) -> bool:
        return True

    def is_on(self) -> bool:
        return self.channel_on

    def make_safe(self) -> None:
        self.off()

    def disconnect(self) -> None:
        self._note("lamp gone")


class NotingSwing:
    """Something that swings between two ends; each command takes its time, or fails on demand."""

    ends: tuple[str, str]

    def __init__(self, clock: VirtualClock, note: Note) -> None:
        self.takes_s = 0.005
        self.fail: Exception | None = None
        self._clock = clock
        self._note = note

    def identity(self) -> str:
        return "noting swing"

    def travel_s(self) -> float:
        return 0.28

    def disconnect(self) -> None:
        self._note("swing gone")

    def swing(self, *, safe: bool) -> None:
        self._clock.sleep(self.takes_s)
        if self.fail:
            raise self.fail
        self._note(self.ends[safe])

    def make_safe(self) -> None:
        self.swing(safe=True)


class NotingDoor(NotingSwing):
    """A trap door."""

    ends = ("door open", "door closed")


class NotingShield(NotingSwing):
    """A shield before the lamp."""

    ends = ("shield covered", "shield uncovered")


class NotingCamera:
    """A camera whose frames say when they began."""

    def __init__(self, clock: VirtualClock, note: Note) -> None:
        self._clock = clock
        self._note = note
        self._settings = ExposureSettings(1.0, 100)

    def identity(self) -> str:
        return "noting camera"

    def capabilities(self) -> CameraCapabilities:
        return CameraCapabilities(
            (0.5, 1.0, 2.0), (100, 400), (4.0,), overhead_s=1.0, frame_bytes=10
        )

    def configure(self, settings: ExposureSettings) -> ExposureSettings:
        self._note(f"configure {settings}")
        self._settings = settings
        return settings

    def arm(self) -> None:
        self._note("arm")

    def shoot(self) -> Frame:
        start_s = self._clock.now()
        self._clock.sleep(self._settings.exposure_s + 1.0)
        end_s = start_s + self._settings.exposure_s
        return Frame(f"frame at {start_s:.3f}".encode(), ".raw", start_s, end_s, self._settings)

    def make_safe(self) -> None:
        self._note("camera safe")

    def disconnect(self) -> None:
        self._note("camera gone")


class Watching:
    """An observer that keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.answers: list[str | None] = []

    def unit(self, name: str, number: int, total: int) -> None:
        self.told.append(f"unit {name} {number}/{total}")

    def doing(self, what: str, until_s: float | None = None) -> None:
        self.told.append(what)

    def frame(self, record: FrameRecord) -> None:
        self.told.append(f"kept {record.role}")

    def warn(self, text: str) -> None:
        self.told.append(f"warning: {text}")

    def ask(self, step: ManualStep, last: str | None, meanwhile: Callable[[], None]) -> str | None:
        """Answers from `answers`, then `done` without a remark."""
        self.told.append(f"by hand: {step.what}; before: {last}")
        meanwhile()
        return self.answers.pop(0) if self.answers else ""
