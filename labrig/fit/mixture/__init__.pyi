from .fit import fit_mixture as fit_mixture
from .result import (
    HeldOutError as HeldOutError,
    LightKept as LightKept,
    MixtureCandidate as MixtureCandidate,
    MixtureFit as MixtureFit,
)
from .texture import (
    MixtureTexture as MixtureTexture,
    fit_mixture_texture as fit_mixture_texture,
)
