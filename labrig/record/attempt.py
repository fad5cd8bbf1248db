"""One attempt at a unit: one event-model run, committed by a RunStop with the status `success`."""

import hashlib
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from labrig.foundation.output_file import Disk, write_durably
from labrig.record.frames import (
    ActionRecord,
    FrameRecord,
    SpectrumRecord,
    TemperatureRecord,
)
from labrig.record.journal import VALUES, Journal, described


class AttemptWriter:
    """Writer of what happens in one attempt: every frame to a file, every event to a journal line.

    Only the RunStart, which contains user input, is validated against event-model's schemas:
    validation takes milliseconds between two actions. The tests validate all documents.

    Parameters
    ----------
    journal
        Open journal of the run.
    unit
        Name of the unit attempted.
    frames_folder
        Folder of the frames.
    next_number
        Function that gives the number of the next frame.
    wall
        Function that gives the time in seconds since 1970.
    new_uid
        Function that gives the uid of the next document.
    metadata
        Keys and values of the RunStart: plan, devices, versions.
    disk
        Disk to which frames are written.
    executor
        Executor of the work done while the disk is busy.
    """

    def __init__(
        self,
        journal: Journal,
        unit: str,
        frames_folder: Path,
        next_number: Callable[[], int],
        wall: Callable[[], float],
        new_uid: Callable[[], str],
        metadata: Mapping[str, Any],
        disk: Disk,
        executor: Executor,
    ) -> None:
        # Not above: it takes long to load, and who plans or reads runs does not need it.
        import event_model

        self.unit = unit
        self.uid = new_uid()
        self._journal = journal
        self._frames_folder = frames_folder
        self._next_number = next_number
        self._wall = wall
        self._new_uid = new_uid
        self._disk = disk
        self._executor = executor
        self._bundle = event_model.compose_run(
            uid=self.uid, time=wall(), metadata={**metadata, "unit": unit}
        )
        self._streams: dict[str, Any] = {}
        journal.append("start", self._bundle.start_doc)

    def action(self, record: ActionRecord) -> None:
        """Write one action to the journal."""
        self._event(
            "actions",
            {key: getattr(record, key) for key in VALUES["actions"]},
        )

    def temperature(self, record: TemperatureRecord) -> None:
        """Write one reading of the thermometer to the journal."""
        self._event(
            "temperatures",
            {key: getattr(record, key) for key in VALUES["temperatures"]},
        )

    def frame(
        self,
        data: bytes,
        suffix: str,
        *,
        role: str,
        exposure_s: float,
        iso: int,
        f_number: float | None,
        start_time: float,
        end_time: float,
        late_s: float,
    ) -> FrameRecord:
        """Write one frame, first its file and then its journal line, and return its record."""
        path = self._frames_folder / f"{self._next_number():06d}{suffix}"
        began = self._wall()
        # Hashed while the disk is busy: of a 25 MB frame that is a quarter of the time.
        checksum = self._executor.submit(hashlib.sha256, data)
        write_durably(path, data, self._disk)
        record = FrameRecord(
            path=path,
            sha256=checksum.result().hexdigest(),
            size_bytes=len(data),
            unit=self.unit,
            role=role,
            exposure_s=exposure_s,
            iso=iso,
            f_number=f_number,
            start_time=start_time,
            end_time=end_time,
            late_s=late_s,
            disk_s=self._wall() - began,
        )
        content = {key: getattr(record, key) for key in VALUES["frames"] if key != "frame"}
        self._event("frames", {"frame": f"frames/{path.name}", **content})
        return record

    def spectrum(
        self,
        data: bytes,
        *,
        role: str,
        integration_s: float,
        repetitions: int,
        start_time: float,
        end_time: float,
        late_s: float,
    ) -> SpectrumRecord:
        """Write one reading of the spectrometer, its file among the frames, then its line."""
        path = self._frames_folder / f"{self._next_number():06d}.csv"
        write_durably(path, data, self._disk)
        record = SpectrumRecord(
            path=path,
            sha256=hashlib.sha256(data).hexdigest(),
            size_bytes=len(data),
            unit=self.unit,
            role=role,
            integration_s=integration_s,
            repetitions=repetitions,
            start_time=start_time,
            end_time=end_time,
            late_s=late_s,
        )
        content = {key: getattr(record, key) for key in VALUES["spectra"] if key != "frame"}
        self._event("spectra", {"frame": f"frames/{path.name}", **content})
        return record

    def stop(self, exit_status: str, reason: str = "") -> None:
        """Write the RunStop of the attempt; the status `success` commits it."""
        self._journal.append(
            "stop",
            self._bundle.compose_stop(
                exit_status=exit_status,
                reason=reason,
                uid=self._new_uid(),
                time=self._wall(),
                validate=False,
            ),
        )

    def _event(self, stream: str, data: dict[str, Any]) -> None:
        if stream not in self._streams:
            self._streams[stream] = self._declare(stream)
        time = self._wall()
        event = self._streams[stream].compose_event(
            data=data,
            timestamps=dict.fromkeys(data, time),
            uid=self._new_uid(),
            time=time,
            validate=False,
        )
        self._journal.append("event", event)

    def _declare(self, stream: str) -> Any:
        bundle = self._bundle.compose_descriptor(
            name=stream,
            data_keys=described(stream),
            uid=self._new_uid(),
            time=self._wall(),
            validate=False,
        )
        self._journal.append("descriptor", bundle.descriptor_doc)
        return bundle
