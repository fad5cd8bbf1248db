"""The viewfinder: a live view for aiming, be it the camera's or a webcam beside it."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role


@runtime_checkable
class LiveView(Device, Protocol):
    """Shows what it sees, for aiming and focusing before the lights go out. Safe: switched off."""

    def preview(self) -> bytes:
        """One live picture, a JPEG. The first one starts the live view, `make_safe` stops it.

        Raises
        ------
        DeviceError
            There is no live view, or no picture comes.
        """


def _exercise(viewfinder: LiveView, trial: ExerciseContext) -> Exercised:
    """Have it show one picture; a camera in its place takes no photographs."""
    asked_s = trial.clock.now()
    jpeg = viewfinder.preview()
    shown_s = trial.clock.now() - asked_s
    return Exercised(
        (
            trial.eyes.live_picture(jpeg),
            Measured("until it was shown", f"{shown_s * 1e3:.0f} ms"),
        )
    )


VIEWFINDER: Role[LiveView] = Role(
    key="viewfinder", does=LiveView, name="viewfinder", exercise=_exercise
)
