from .fit import (
    AlbedoFit as AlbedoFit,
    LitStrip as LitStrip,
    fit_albedo as fit_albedo,
    relative_to_card as relative_to_card,
    unresolved as unresolved,
)
from .luminescence import (
    Luminescence as Luminescence,
    StripLight as StripLight,
    luminescence_by_glow as luminescence_by_glow,
)
