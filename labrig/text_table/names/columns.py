"""Names of columns in tables from anywhere: times and their units, uncertainties, row numbers."""

import re

#: Names of a column of times, in lower case and without a unit.
_TIMES = frozenset(
    {
        "t", "time", "times", "elapsed", "elapsed time", "decay time", "delay", "delay time",
        "zeit", "zeitpunkt", "messzeit", "verzögerung", "temps", "durée", "tempo", "tiempo",
        "tijd", "tid", "aika", "czas", "čas", "время", "時間", "时间",
        "seconds", "second", "sec", "sekunden", "secondes", "minutes", "minuten", "hours",
        "stunden", "milliseconds", "millisekunden", "microseconds", "nanoseconds", "picoseconds",
    }
)  # fmt: skip
#: Units that alone name a column of times; `min` may be a minimum, `d` a distance.
_TIMES_BY_UNIT = frozenset({"fs", "ps", "ns", "us", "ms", "nsec", "usec", "msec"})
#: Names of the abscissa, if no column is called a time.
ABSCISSAS = frozenset({"x", "x_value", "x-value", "x value", "lifetime", "timestamp"})
#: Names of a column that counts channels of a memory, or bins of a histogram.
_CHANNELS = frozenset({"chan", "channel", "channels", "ch", "ch.", "bin", "bins", "kanal", "canal"})
_NUMBER_OF = re.compile(r"\s*(?:#|no\.?|nr\.?|numbers?|nummer)$")
#: Names of other abscissas, and their units, which tell a header that is no table of times.
_OTHER_ABSCISSAS = frozenset(
    {
        "wavelength", "wavelengths", "wave", "wave length", "wl", "lambda", "λ", "nm",
        "wellenlänge", "longueur d'onde", "wavelength_nm", "wavenumber", "wave number",
        "wellenzahl", "raman shift", "energy", "photon energy", "frequency",
    }
)  # fmt: skip
_OTHER_UNITS = frozenset({"nm", "nanometers", "nanometres", "um", "a", "å", "cm-1", "1/cm", "ev"})
#: Units of time in seconds by their names, in lower case.
_UNITS_S = {
    unit: seconds
    for seconds, units in (
        (1e-15, ("fs", "fsec", "femtosecond", "femtoseconds")),
        (1e-12, ("ps", "psec", "picosec", "picosecond", "picoseconds", "pikosekunden")),
        (1e-9, ("ns", "nsec", "nanosec", "nanosecond", "nanoseconds", "nanosekunden",
                "nanosecondes", "nanosegundos", "нс")),
        (1e-6, ("us", "usec", "microsec", "microsecond", "microseconds", "mikrosekunden",
                "microsecondes", "microsegundos", "мкс")),
        (1e-3, ("ms", "msec", "millisec", "millisecond", "milliseconds", "millisekunden",
                "millisecondes", "milisegundos", "мс")),
        (1.0, ("s", "sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden", "secondes",
               "segundos", "secondi", "с", "秒")),
        (60.0, ("min", "mins", "minute", "minutes", "minuten", "minutos", "minuti", "мин", "分")),
        (3600.0, ("h", "hr", "hrs", "hour", "hours", "std", "stunde", "stunden", "heures",
                  "horas", "ore", "ч")),
        (86400.0, ("d", "day", "days", "tag", "tage", "jours", "días", "dias")),
    )
    for unit in units
}  # fmt: skip
#: Unit with a power of ten before it: `10^-9 s`, `x10⁻⁶ s`, `1E-3 sec`.
_POWER_OF_TEN = re.compile(
    r"(?:[x×*·]\s*)?(?:10\s*\^?\s*\(?(?P<power>[+-]?\d+)\)?|1(?:\.0*)?e(?P<e>[+-]?\d+))"
    r"[\s*·x×]*(?P<unit>[^\W\d_]+)"
)
#: Letters that look alike, and blanks that do not break a line, as units are written with them.
_TYPOGRAPHY = str.maketrans({"µ": "u", "μ": "u", "\u00a0": " ", "⁻": "-", "−": "-", "¹": "1"})
_POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁺", "0123456789+")
#: Names of an uncertainty, in lower case.
_SIGMA = (
    r"sigma|σ|±|\+/-|\+-|errors?|err|std|std\.? ?dev\.?|stdev|standard deviation|standard error|"
    r"uncertainty|uncert|unc|s\.?d\.?|s\.?e\.?|u|δ|delta|fehler|unsicherheit|abweichung|"
    r"standardabweichung|erreur|incertitude|[dy]?error|y ?err|dy"
)
_SIGMA_ALONE = re.compile(_SIGMA)
_SIGMA_AFTER = re.compile(rf"(?P<of>.+?)(?:[\s_.\-]+(?:{_SIGMA})|\s*[±σ])")
_SIGMA_BEFORE = re.compile(
    rf"(?:(?:{_SIGMA})[\s_.\-]+(?:(?:of|in|von|de)\s+)?|[±σδ]\s*|d_)(?P<of>.+)"
)
_SIGMA_OF = re.compile(rf"(?:{_SIGMA})\s*\((?P<of>.+)\)")
_ROW_NUMBERS = frozenset(
    {
        "", "#", "no", "no.", "nr", "nr.", "n", "index", "point", "row", "id", "sample", "frame",
        "record",
    }
)  # fmt: skip
#: Forms of a name with its unit: `time (s)`, `I [a.u.]`, `t / s`, `Zeit in s`, `time_ms`.
_WITH_UNIT = tuple(
    re.compile(pattern)
    for pattern in (
        r"(?P<name>.*\S)\s*[(\[]\s*(?P<unit>[^()\[\]]*?)\s*[)\]]",
        r"(?P<name>.*?\S)\s+/\s+(?P<unit>\S.*)",
        r"(?P<name>.*\S)\s*/\s*(?P<unit>\S.*)",
        r"(?P<name>.*\S)\s*,?\s+in\s+(?P<unit>\S+)",
    )
)
_TIME_WITH_UNIT = re.compile(
    r"(?P<name>.*[^\s_.,:|{<-])[\s_.,:|{<-]+(?P<unit>[^\s_.,:|{}<>-]+)[}>.]?"
)


def split_unit(name: str) -> tuple[str, str]:
    """Divide a name such as `I [a.u.]` or `time / s` into name and unit, which may be empty."""
    name = " ".join(name.split())
    for form in _WITH_UNIT:
        if match := form.fullmatch(name):
            return match["name"], match["unit"]
    return name, ""


def time_unit_s(unit: str) -> float | None:
    """Return a unit of time in seconds; None if it is none."""
    plain = unit.translate(_TYPOGRAPHY).strip(" ()[]/.").lower()
    if match := _POWER_OF_TEN.fullmatch(plain.translate(_POWERS)):
        seconds = _UNITS_S.get(match["unit"])
        return None if seconds is None else seconds * 10.0 ** int(match["power"] or match["e"])
    return _UNITS_S.get(plain)


def split_time(name: str) -> tuple[str, str] | None:
    """Divide the name of a column of times into name and unit; None if it is no name of times."""
    base, unit = split_unit(name)
    lower = base.translate(_TYPOGRAPHY).lower()
    if lower in _TIMES or (lower in _TIMES_BY_UNIT and not unit):
        return base, unit or (base if time_unit_s(base) is not None else "")
    match = _TIME_WITH_UNIT.fullmatch(base)
    if match and match["name"].lower() in _TIMES and time_unit_s(match["unit"]) is not None:
        return match["name"], match["unit"]
    return None


def is_time(name: str) -> bool:
    """Return whether a column of that name holds times."""
    return split_time(name) is not None


def is_channel(name: str) -> bool:
    """Return whether a column of that name counts channels."""
    return _NUMBER_OF.sub("", split_unit(name)[0].lower()) in _CHANNELS


def is_abscissa(name: str) -> bool:
    """Return whether a column of that name holds what values are plotted over."""
    base = split_unit(name)[0].lower()
    return is_time(name) or is_channel(name) or base in ABSCISSAS | _OTHER_ABSCISSAS


def is_abscissa_unit(text: str) -> bool:
    """Return whether a text is a unit of times, wavelengths, wavenumbers or energies."""
    unit = text.translate(_TYPOGRAPHY).strip(" ()[]").lower()
    return time_unit_s(text) is not None or unit in _OTHER_UNITS


def is_row_number(name: str) -> bool:
    """Return whether a column of that name may number the rows."""
    return name.lower() in _ROW_NUMBERS


def is_sigma(name: str) -> bool:
    """Return whether a column of that name holds the uncertainty of another one."""
    return _SIGMA_ALONE.fullmatch(split_unit(name)[0].lower()) is not None


def sigma_of(name: str) -> str | None:
    """Return the name, in lower case, of the column whose uncertainty `name` says it is."""
    lower = " ".join(name.lower().split())
    for text in (lower, split_unit(lower)[0]):
        for form in (_SIGMA_OF, _SIGMA_AFTER, _SIGMA_BEFORE):
            if match := form.fullmatch(text):
                return match["of"].strip()
    return None
