"""Files of pictures that a command draws."""

from pathlib import Path
from typing import TYPE_CHECKING

from labrig.errors import DiskError, UsageError

# matplotlib is slow to load.
if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = (".png", ".svg", ".pdf")
DPI = 150


def require_picture(path: Path) -> None:
    """Refuse, before anything is drawn, a file name that is not that of a picture.

    Parameters
    ----------
    path
        Path of the picture.

    Raises
    ------
    UsageError
        It does not end in `.png`, `.svg` or `.pdf`.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.report import require_picture
    >>> require_picture(Path("glow.png"))
    """
    if path.suffix.lower() not in PICTURES:
        raise UsageError(f"{path}: expected a file name that ends in {', '.join(PICTURES)}")


def save_picture(figure: "Figure", path: Path) -> None:
    """Write a figure into a file, in the format of its ending.

    Raises
    ------
    DiskError
        The file cannot be written.
    """
    try:
        figure.savefig(path, dpi=DPI)
    except OSError as error:
        raise DiskError(f"{path}: cannot be written ({error.strerror})") from None
