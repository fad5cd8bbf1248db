"""Files of pictures that a command draws."""

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from labrig.foundation.errors import UsageError
from labrig.foundation.output_file import write_durably

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


def save_picture(figure: "Figure", path: Path, dpi: float = DPI) -> None:
    """Write a figure into a file, in the format of its ending.

    Parameters
    ----------
    figure
        Figure of matplotlib.
    path
        Path of the file, which ends in `.png`, `.svg` or `.pdf`.
    dpi
        Pixels of each inch.

    Raises
    ------
    DiskError
        The file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.report import new_figure, save_picture
    >>> save_picture(new_figure(200), Path("empty.png"))
    >>> Path("empty.png").is_file()
    True
    """
    content = BytesIO()
    figure.savefig(content, format=path.suffix[1:].lower(), dpi=dpi)
    write_durably(path, content.getvalue())
