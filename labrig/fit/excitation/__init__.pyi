from .charging import (
    Charging as Charging,
    closure as closure,
)
from .course import (
    ExcitationCourse as ExcitationCourse,
    excitation_course as excitation_course,
)
from .fit import fit_excitation as fit_excitation
from .intervals import IntervalChoice as IntervalChoice
from .layer import layer_effect as layer_effect
from .levels import levels_at_off as levels_at_off
from .parameters import RelativeSigmas as RelativeSigmas
