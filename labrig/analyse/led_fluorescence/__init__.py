"""Analysis of a fluorescence run, from frames under LEDs to re-radiation matrices."""

from labrig.analyse.led_fluorescence.analysis import analyse

__all__ = ["analyse"]
