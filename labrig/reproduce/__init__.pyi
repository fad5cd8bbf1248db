from .display import (
    Display as Display,
    camera_values as camera_values,
    tristimulus as tristimulus,
)
from .field import (
    Field as Field,
)
from .field_parameters import (
    FieldParameters as FieldParameters,
)
from .night import (
    NightLook as NightLook,
    night_view as night_view,
    scotopic_luminance as scotopic_luminance,
)
