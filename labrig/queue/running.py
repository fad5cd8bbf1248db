"""The measurements of a queue, made one after another; what was interrupted goes on."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from filelock import Timeout

from labrig.acquire import SAMPLE_CHANGER, RigFile, driver_and_settings, read_run_rig
from labrig.bench import Recording, Watch, resume_run
from labrig.catalogue import summarise
from labrig.foundation.activity import activity
from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.foundation.file_lock import plain_lock
from labrig.process import process_and_report, reduced_ahead
from labrig.queue.queue_file import Queue, QueuedRun, change_queue, read_queue
from labrig.queue.results import QueueEntry, entries, write_results
from labrig.record import RunSize

#: Status of a run that needs nothing more.
COMPLETE = "processed"


class Attendant(Protocol):
    """Whoever attends a queue: a person at a terminal, or a program."""

    def prepare(self, queued: QueuedRun) -> Recording:
        """Return a measurement ready to be recorded."""

    def watch(self, rig: RigFile) -> Watch:
        """Return an observer for a run on a rig."""

    def change_sample(self, before: str, after: str) -> None:
        """Put another sample in place."""

    def tell(self, text: str) -> None:
        """Take note of what happens."""


def run_queue(path: Path, runs: Path, attendant: Attendant) -> Path:
    """Make all measurements of a queue that are not complete, and write their results.

    The file is read anew before each, so that measurements may be added meanwhile. A run that
    cannot be fitted is told and kept, and the queue goes on; any other error ends it.

    Parameters
    ----------
    path
        File of the queue.
    runs
        Folder for the run folders.
    attendant
        Whoever attends it.

    Returns
    -------
    Path
        Page with the results of all runs, in the folder `QUEUE-results` beside the file.

    Raises
    ------
    UsageError
        A measurement cannot work, and nothing has moved; or another process runs this queue.
    DataError
        Some runs could not be reduced or fitted; all others are complete.
    Interrupted, LabrigError
        A run ended early, in the safe state; to run the queue again goes on with it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.queue import Queue, QueuedRun, change_queue, run_queue
    >>> queue = Queue(runs=(QueuedRun(protocol="decay", run="decay"),))
    >>> _ = change_queue(Path("done.yaml"), lambda before: queue)
    >>> run_queue(Path("done.yaml"), Path("runs"), attendant=None).as_posix()
    'done-results/report.html'
    """
    with _alone(path):
        for entry in entries(read_queue(path), runs):
            if entry.summary is None:
                _prepared(path, entry, attendant)
        failed: list[int] = []
        while True:
            listed = entries(read_queue(path), runs)
            page = write_results(path.with_name(f"{path.stem}-results"), path.stem, listed)
            due = [
                entry for entry in listed if entry.status != COMPLETE and entry.number not in failed
            ]
            if not due:
                break
            done = [entry for entry in listed if entry.summary and entry.number < due[0].number]
            before = done[-1].summary.sample if done and done[-1].summary else ""
            attendant.tell(f"{due[0].number} of {len(listed)}: {_words(due[0].queued)}")
            try:
                recorded = _recorded(path, runs, due[0], before, attendant)
                with activity(f"processing {recorded.name}"):
                    process_and_report(recorded)
            except DataError as error:
                failed.append(due[0].number)
                attendant.tell(f"{due[0].number}: {error}")
        if failed:
            raise DataError(
                f"{path}: {len(failed)} of {len(listed)} runs could not be reduced or fitted "
                f"(no. {', '.join(map(str, failed))}); they are kept, see {page}"
            )
        return page


def _recorded(path: Path, runs: Path, entry: QueueEntry, before: str, attendant: Attendant) -> Path:
    """Record a measurement, or what is missing of it, and return the run folder."""
    if entry.summary is None:
        recording = _prepared(path, entry, attendant)
        sample = recording.protocol.sample_in_place
        is_brought = sample is None or sample in _on_changer(recording)
        if before and sample is not None and sample != before and not is_brought:
            attendant.change_sample(before, sample)
        with reduced_ahead() as begun:

            def noted(folder: Path, size: RunSize) -> None:
                _note(path, entry, folder.name)
                begun(folder, size)

            return recording.record(attendant.watch(recording.rig), noted)
    folder = entry.summary.folder
    if summarise(folder).status != "recorded":
        with reduced_ahead() as begun:
            resume_run(folder, attendant.watch(read_run_rig(folder)), begun=begun)
    return folder


def _on_changer(recording: Recording) -> Sequence[str]:
    """Return the samples that the rig's sample changer brings by itself."""
    if SAMPLE_CHANGER.key not in recording.rig.devices:
        return ()
    _, settings = driver_and_settings(recording.rig, SAMPLE_CHANGER.key, recording.rig.name)
    return tuple(settings.samples)


def _prepared(path: Path, entry: QueueEntry, attendant: Attendant) -> Recording:
    """Prepare a measurement; what is wrong is told with its number."""
    try:
        return attendant.prepare(entry.queued)
    except LabrigError as error:
        error.args = (f"{path}, no. {entry.number}: {error}",)
        raise


def _note(path: Path, entry: QueueEntry, run: str) -> None:
    """Write the name of a run to its measurement, which may have moved in the file meanwhile."""

    def noted(queue: Queue) -> Queue:
        places = [n for n, queued in enumerate(queue.runs) if queued == entry.queued]
        if not places:
            raise UsageError(f"{path}: no. {entry.number} was changed as it began; run it again")
        place = min(places, key=lambda n: abs(n - (entry.number - 1)))
        changed = list(queue.runs)
        changed[place] = entry.queued.model_copy(update={"run": run})
        return Queue(runs=tuple(changed))

    change_queue(path, noted)


def _words(queued: QueuedRun) -> str:
    changes = ", ".join(f"{key} {value}" for key, value in queued.changes.items())
    return f"{queued.protocol}{f', {changes}' if changes else ''}"


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a queue that is being run."""
    read_queue(path)  # no lock is made beside a file that is none of ours
    try:
        with plain_lock(path.with_name(f".{path.name}.running"), timeout_s=0):
            yield
    except Timeout:
        raise UsageError(f"{path}: another labrig runs this queue") from None
