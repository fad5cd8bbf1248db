"""Files that are replaced at once: whoever reads one finds the old or the new, never a half."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from labrig.errors import DiskError


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """Yield the path of a draft beside a file, which takes the file's place at the end.

    Raises
    ------
    DiskError
        The draft or the file cannot be written.
    """
    # Some writers tell the format by the ending.
    draft = path.with_name(f".{path.stem}.draft{path.suffix}")
    try:
        yield draft
        draft.replace(path)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
