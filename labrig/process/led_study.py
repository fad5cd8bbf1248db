"""Result and page of a comparison of sets of LEDs."""

from pathlib import Path

from labrig.process.without_run import describe_without_run, write_with_report
from labrig.report import ComparedLeds, led_study_report


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
    about = describe_without_run(
        "How many LEDs, and where", "led_study", compared.of_surfaces, [("Command", command)]
    )
    page = led_study_report(compared, about)
    return write_with_report(folder, "led_study.json", compared.to_json(), page)
