"""Meaning of the names of columns and of their units: times, σ, row numbers, values.

A decay is one of light itself. Which function of it a column holds is said by its name or unit;
where that leaves two readings, the column is refused.
"""

import math
import re
from dataclasses import dataclass, replace

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError

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


_DECIBEL = re.compile(
    r"(?:(?P<name>.+?)[\s_/]+)?(?P<unit>d[Bb][\s(]*(?P<to>[mnuµμ]?W|m|c|FS|[muµμ]?V|u|[muµμ]?A)?\)?)"
    r"(?:\s*re\.?\s*(?:1\s*)?(?P<re>\S+))?"
)
#: References of decibels of a power, with the unit, and of an amplitude.
_OF_POWER = {"m": "mW", "mW": "mW", "W": "W", "µW": "µW", "uW": "µW", "nW": "nW", "c": ""}
_OF_AMPLITUDE = {"V": "V", "mV": "mV", "µV": "µV", "uV": "µV", "u": "", "FS": ""}
#: Words in names of quantities whose decibels are those of a power, and of an amplitude.
_UNIT_POWERS = frozenset(
    {
        "i", "p", "pl", "el", "intensity", "intensität", "intensité", "power", "leistung", "light",
        "licht", "radiance", "irradiance", "luminance", "leuchtdichte", "flux", "brightness",
        "counts", "emission", "luminescence", "phosphorescence", "fluorescence", "afterglow",
        "optical", "photons",
    }
)  # fmt: skip
_AMPLITUDES = frozenset(
    {"u", "v", "volt", "volts", "voltage", "spannung", "tension", "amplitude", "current", "strom"}
)
_BASES = {
    "ln": math.e, "loge": math.e, "log10": 10.0, "lg": 10.0, "log2": 2.0, "ld": 2.0, "lb": 2.0,
}  # fmt: skip
_LOG = r"(?P<log>ln|lg|ld|lb|log(?:[\s_]?(?:e|10|2))?)"
_LOGARITHM = re.compile(
    rf"(?P<sign>[-+]?)\s*{_LOG}"
    r"(?:\s*[(\[{]\s*(?P<in>.+?)\s*[)\]}]?|[\s_]+(?:of\s+)?(?P<after>[^\W\d].*?)|)"
    r"(?:\s*[(\[](?:a\.?\s?u\.?|arb.*|1|-)?[)\]])?",
    re.IGNORECASE,
)
#: A light divided into that at the start: its logarithm grows.
_INVERSE = re.compile(r"[_\s(]*(?:0|max|t\s*=\s*0)\)?\s*/")
_MAGNITUDE = re.compile(r"(?P<milli>m?)mag(?:\b.*)?")
#: The same without a blank: `lnI`, but not `Login`.
_GLUED = re.compile(r"(?P<log>ln|lg|log(?:10|2)?)(?P<of>[A-Z].*)")
#: Words for a logarithm: `natural log of I`, `I_log`, `Intensity, ln`, `log-transformed signal`.
_WORDED = re.compile(
    r"(?P<kind>natural|decadic|common|decimal)[\s_-]*log(?:arithm)?\s*(?:\(?of\b)?\s*\(?(?P<in>.*?)\)?"
    r"|(?P<before>.+?)[\s_,;:-]+(?P<log>ln|lg|log(?:[\s_]?(?:e|10|2))?)"
    r"(?P<scale>[\s_-]*(?:scale|units?|transformed|values?))?"
    r"|log[\s_-]*(?:arithm(?:ic|us)?|transformed|scaled?)\b.*",
    re.IGNORECASE,
)
#: `E (ln(lx))`: a unit that is a logarithm.
_NESTED = re.compile(
    rf"(?P<name>.+?)\s*[(\[]\s*(?P<unit>{_LOG}\s*[(\[].+[)\]])\s*[)\]]", re.IGNORECASE
)
_KINDS = {"natural": "ln", "decadic": "log10", "common": "log10", "decimal": "log10"}
_OTHER_FUNCTION = re.compile(r"1\s*/\s*\(?(?P<of>[^\W\d].*)|(?:sqrt|exp)\s*\(.*|√.*", re.IGNORECASE)
_ABSORBANCE = frozenset({"absorbance", "abs", "od", "mod", "extinction", "extinktion", "absorbanz"})


@dataclass(frozen=True)
class LogScale:
    """Logarithm of light: light = base^(x / divisor).

    Attributes
    ----------
    name, unit
        Name and unit of the light; either may be empty.
    unit_of_x
        Unit of the logarithm.
    base, divisor
        Numbers of the formula.
    """

    name: str
    unit: str
    unit_of_x: str
    base: float
    divisor: float

    def light(self, x: FloatArray) -> FloatArray:
        """Return the light at logarithms of it; infinite where it is too large for a number."""
        with np.errstate(over="ignore"):
            return np.asarray(self.base ** (x / self.divisor), dtype=np.float64)

    def sigma(self, x: FloatArray, sigma: FloatArray) -> FloatArray:
        """Return σ of the light by σ of its logarithm, to first order."""
        return self.light(x) * abs(math.log(self.base) / self.divisor) * sigma

    def require_unit(self, unit: str, name: str) -> None:
        """Refuse uncertainties `name` whose unit is not that of the logarithm.

        Raises
        ------
        UsageError
            The unit is another one, as that of the light or %.
        """
        if unit.strip() not in ("", self.unit_of_x, "dB" if self.unit_of_x else ""):
            own = f" in {self.unit_of_x}" if self.unit_of_x else ""
            raise UsageError(
                f"expected uncertainties of the logarithm{own}, got '{unit}' in '{name}'; convert "
                "them, or delete the column: σ is then taken from the scatter"
            )

    def __str__(self) -> str:
        """Return the formula, with x for the values of the column."""
        base = "e" if self.base == math.e else f"{self.base:g}"
        if self.divisor == 1:
            return f"{base}^x"
        sign = "−" if self.divisor < 0 else ""
        return f"{base}^({sign}x/{abs(self.divisor):g})"


def log_scale(name: str, unit: str = "") -> LogScale | None:
    """Return of which light a column holds the logarithm, by its name; None if it holds light.

    Parameters
    ----------
    name
        Name of the column as it stands in the table, perhaps with a unit.
    unit
        Its unit, if a line of units has it.

    Raises
    ------
    UsageError
        The name has two readings, such as `log(I)`, or is that of another function of light.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.text_table.names import log_scale
    >>> scale = log_scale("I/dB")
    >>> scale.name, str(scale), scale.light(np.array([0.0, 30.0])).tolist()
    ('I', '10^(x/10)', [1.0, 1000.0])
    >>> str(log_scale("ln(I)")), log_scale("I / mV") is None
    ('e^x', True)
    """
    name = " ".join(name.replace("\N{MINUS SIGN}", "-").split())
    nested = _NESTED.fullmatch(name)
    base, own_unit = (nested["name"], nested["unit"]) if nested else split_unit(name)
    unit = (own_unit or unit).strip()
    # A unit below the name, or in its brackets, says more than the name.
    if match := _DECIBEL.fullmatch(unit):
        return _decibel(base, match, name)
    if match := _DECIBEL.fullmatch(name):
        return _decibel(match["name"] or "", match, name)
    if match := _MAGNITUDE.fullmatch(unit):
        return LogScale(base, "", unit, 10.0, -2500.0 if match["milli"] else -2.5)
    if unit.lower().replace("_", "") in {*_BASES, "log"}:
        return _logarithm(unit, base, name)
    if match := _LOGARITHM.fullmatch(unit):
        # `E` above `ln(lx)`, or `E [ln(lx)]`.
        scale = _logarithm(match["log"], base, name, match["sign"])
        return replace(scale, unit=match["in"] or match["after"] or "")
    if match := _LOGARITHM.fullmatch(name):
        return _logarithm(match["log"], match["in"] or match["after"] or "", name, match["sign"])
    match = _WORDED.fullmatch(base)
    # Of a lamp's or a sensor's log nobody knows that it is logarithmic; of an intensity's one does.
    if match and (
        (match["log"] or "").lower() != "log" or match["scale"] or _is_light(match["before"])
    ):
        log = _KINDS.get((match["kind"] or "").lower()) or match["log"] or "log"
        return _logarithm(log, match["in"] or match["before"] or "", name)
    if match := _GLUED.fullmatch(name):
        return _logarithm(match["log"], match["of"], name)
    other = _OTHER_FUNCTION.fullmatch(name)
    if other and not (other["of"] and time_unit_s(other["of"]) is not None):
        raise UsageError(
            f"expected light, got a function of it, '{name}'; write the light itself, or its "
            "logarithm as ln(I), log10(I) or I/dB"
        )
    return None


def is_absorbance(name: str) -> bool:
    """Return whether a column of that name holds absorbances, which are logarithms by nature.

    Over time they are what decays, since they are proportional to what absorbs.
    """
    return split_unit(name)[0].lower().strip("δ∆ ") in _ABSORBANCE


def _is_light(name: str) -> bool:
    return len(name) == 1 or name.lower() in {*_UNIT_POWERS, *_AMPLITUDES, "signal", "value"}


def _decibel(name: str, said: re.Match[str], column: str) -> LogScale:
    reference = (said["to"] or said["re"] or "").replace("μ", "µ")
    words = set(re.findall(r"[^\W\d_]+", name.lower()))
    is_power = reference in _OF_POWER or (not reference and bool(words & _UNIT_POWERS))
    is_amplitude = reference in _OF_AMPLITUDE or (not reference and bool(words & _AMPLITUDES))
    if is_power == is_amplitude:
        raise UsageError(
            f"expected decibels of a power (10 lg) or of a voltage (20 lg), got '{column}', which "
            "may be either; call the column 'power/dB' or 'voltage/dB'"
        )
    light_unit = _OF_POWER.get(reference) or _OF_AMPLITUDE.get(reference) or ""
    return LogScale(name.strip(" _"), light_unit, said["unit"], 10.0, 10.0 if is_power else 20.0)


def _logarithm(log: str, of: str, column: str, sign: str = "") -> LogScale:
    base = _BASES.get(re.sub(r"[\s_]", "", log.lower()))
    if base is None or sign == "-" or _INVERSE.search(of):
        raise UsageError(
            f"expected light, or a logarithm of it that can be read in one way, got '{column}'; "
            "call it ln(I) if it is natural, log10(I) if it is decimal, or write the light itself"
        )
    light, unit = split_unit(of)
    is_ratio = re.search(r"/.*0\)?$", of.strip()) is not None
    return LogScale(of if is_ratio else light, "" if is_ratio else unit, "", base, 1.0)
