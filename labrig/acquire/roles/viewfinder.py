"""The viewfinder, a live view for aiming, by the camera or by a webcam next to it."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, ExerciseContext, Exercised, Measured, Role


@runtime_checkable
class LiveView(Device, Protocol):
    """A live view for aiming and focusing while the lights are on. Safe state: switched off."""

    def preview(self) -> bytes:
        """Return one live picture as a JPEG.

        The first call starts the live view, `make_safe` stops it.

        Raises
        ------
        DeviceError
            If there is no live view, or no picture arrives.
        """


def _exercise(viewfinder: LiveView, context: ExerciseContext) -> Exercised:
    """Take one live picture; a camera in this role takes no photographs."""
    start_s = context.clock.now()
    jpeg = viewfinder.preview()
    duration_s = context.clock.now() - start_s
    return Exercised(
        (
            context.frame_reader.live_picture(jpeg),
            Measured("until it was shown", f"{duration_s * 1e3:.0f} ms"),
        )
    )


VIEWFINDER: Role[LiveView] = Role(
    key="viewfinder", protocol_class=LiveView, name="viewfinder", exercise=_exercise
)
