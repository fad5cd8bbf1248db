"""Options of `labrig process` for a saturation test."""

from labrig.analyse.process_options import RateOption, StatesOption


class SaturationOptions(StatesOption, RateOption):
    """Options of the fits of all decays."""
