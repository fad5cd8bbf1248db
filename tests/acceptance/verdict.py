"""Comparison of a figure that is measured anew with the published one."""

import re

#: Numbers of one figure agree within this fraction and one unit of the last digit published.
TOLERANCE = 0.1
_NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def agrees(published: str, measured: str, *, timed: bool = False) -> bool:
    """Return whether the words are the same, and the numbers but for little.

    A published whole number of zero, such as a count of failures, has to remain zero. Numbers that
    are durations (`timed`) depend on the computer and are not compared.
    """
    if _words(published) != _words(measured):
        return False
    pairs = zip(_NUMBER.findall(published), _NUMBER.findall(measured), strict=True)
    return timed or all(_near(before, now) for before, now in pairs)


def _words(text: str) -> list[str]:
    return _NUMBER.sub("#", text).split()


def _near(published: str, measured: str) -> bool:
    before, now = (float(text.replace("−", "-")) for text in (published, measured))
    if re.fullmatch(r"[-+−]?0", published):
        return now == 0
    mantissa, _, exponent = published.partition("e")
    decimals = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent or 0) - decimals)
    return abs(now - before) <= TOLERANCE * abs(before) + 1.0001 * unit
