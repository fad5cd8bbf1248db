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
