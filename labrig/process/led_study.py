"""Result and page of a comparison of sets of LEDs."""

from importlib.metadata import version
from pathlib import Path

from labrig.errors import DiskError
from labrig.process.provenance import library_versions
from labrig.record import RunDescription
from labrig.report import ComparedLeds, led_study_report, write_report


def report_led_study(compared: ComparedLeds, command: str, folder: Path) -> Path:
    """Write `led_study.json` and the page of a comparison of sets of LEDs into a folder.

    Parameters
    ----------
    compared
        The sets of LEDs.
    command
        Command that does the same again.
    folder
        Folder, made if there is none; earlier files of the same names are replaced.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from labrig.fit.fluorescence import LedSet, LedStudy
    >>> from labrig.process import report_led_study
    >>> from labrig.report import ComparedLeds
    >>> study = LedStudy(("felt", "paper"), ("D65",), np.array([[0.5], [1.0]]))
    >>> compared = ComparedLeds((LedSet("even", (400, 500, 600), study),), "mine", "2 papers")
    >>> report_led_study(compared, "labrig leds study --number 3", Path("leds")).as_posix()
    'leds/report.html'
    """
    about = RunDescription(
        title="How many LEDs, and where",
        protocol="led_study",
        run=compared.of_surfaces,
        started="",
        ended="",
        rig="",
        simulated=False,
        labrig_version=version("labrig"),
        libraries=tuple(library_versions().items()),
        sample=(("Command", command),),
    )
    report = folder / "report.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "led_study.json").write_text(compared.to_json() + "\n", encoding="utf-8")
    except OSError as error:
        raise DiskError(f"{folder}: cannot be written ({error.strerror})") from None
    write_report(report, led_study_report(compared, about))
    return report
