from .field import (
    Field as Field,
)
from .field_parameters import (
    FieldParameters as FieldParameters,
)
