"""Frames as libgphoto2 reports them: the one that is due, and abandoned ones."""

from pathlib import PurePosixPath

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from .library import AT_ONCE_S, Library

#: Interval at which a request to stop is noticed.
LISTEN_S = 0.2
_JPEG = b"\xff\xd8\xff"
#: Suffix that libgphoto2 gives to unknown formats of a Canon, even a RAW file in TIFF.
_UNKNOWN = ".jpg"
_TIFF = (b"II*\0", b"MM\0*")


class Frames:
    """Bookkeeping of the frame that is due, so that none is ever taken for another.

    Parameters
    ----------
    library
        Library that reports and transfers the frames.
    clock
        Clock of the waiting for frames.
    timeout_s
        Seconds from the end of an exposure until its frame must be there.
    """

    def __init__(self, library: Library, clock: Clock, timeout_s: float) -> None:
        self._library = library
        self._clock = clock
        self._timeout_s = timeout_s
        self._due_after_s: float | None = None

    def expect(self, exposure_end_s: float) -> None:
        """Note that an exposure has begun, or may have, and ends at this clock time at latest."""
        self._due_after_s = exposure_end_s

    def expect_none(self) -> None:
        """Note that no exposure is under way."""
        self._due_after_s = None

    def exposing_for_s(self) -> float:
        """Return the seconds for which the camera may still expose."""
        now_s = self._clock.now()
        return max(0.0, (self._due_after_s or now_s) - now_s)

    def fetch(self) -> tuple[bytes, str]:
        """Return the bytes of the frame that is due and its suffix, such as `.nef`.

        Raises
        ------
        DeviceError
            No frame came, or one that is no RAW file.
        """
        file = self._wait()
        if file is None:
            raise DeviceError(
                f"expected a frame within {self._timeout_s:g} s of the exposure's end, libgphoto2 "
                "reported none: set the lens to manual focus (MF), mirror lock-up and self-timer "
                "off, and let the camera keep its frames for the PC"
            )
        self._due_after_s = None
        folder, name = file
        data = self._library.read(folder, name, self._timeout_s)
        return data, raw_suffix(name, data)

    def discard_abandoned(self) -> None:
        """Wait for an abandoned frame that is due, and pass over all frames.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        if self._due_after_s is not None:
            self._clock.sleep_until(self._due_after_s)
            self._wait()
            self._due_after_s = None
        self.discard_reported()

    def discard_reported(self) -> None:
        """Pass over the frames that have been reported.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        while self._library.next_file(AT_ONCE_S, self._timeout_s) is not None:
            self._due_after_s = None

    def _wait(self) -> tuple[str, str] | None:
        deadline_s = (self._due_after_s or self._clock.now()) + self._timeout_s
        while True:
            # Looked at before the camera: this process may be stopped between the two.
            is_last = self._clock.now() >= deadline_s
            file = self._library.next_file(LISTEN_S, self._timeout_s)
            if file is not None or is_last:
                return file


def raw_suffix(name: str, data: bytes) -> str:
    """Return the suffix of a RAW file, by its name and its first bytes.

    Raises
    ------
    DeviceError
        The file is empty, a JPEG or no photograph at all.
    """
    suffix = PurePosixPath(name).suffix.lower()
    if not data or data.startswith(_JPEG) or not suffix[1:].isalnum():
        raise DeviceError(
            f"expected a RAW file from the camera, it sent {name!r} of {len(data)} bytes"
            + (", a JPEG" if data.startswith(_JPEG) else "")
            + ": set its image quality to RAW alone"
        )
    return ".dng" if suffix == _UNKNOWN and data.startswith(_TIFF) else suffix
