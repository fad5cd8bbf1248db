from .field import (
    Field as Field,
)
from .field_parameters import (
    FieldParameters as FieldParameters,
)
from .wavelength_shift import (
    LampWavelengths as LampWavelengths,
    ShiftedWavelengths as ShiftedWavelengths,
    WavelengthShift as WavelengthShift,
    balance as balance,
    direct_light as direct_light,
    rotated_wavelengths as rotated_wavelengths,
)
