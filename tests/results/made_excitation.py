"""An excitation's result of two patches, as fits to simulated charges make it."""

import math
from dataclasses import replace

import numpy as np

from labrig.fit.excitation import RelativeSigmas, closure, fit_excitation
from labrig.foundation.result_warning import as_warnings
from labrig.material import read_material
from labrig.protocols.excitation.result import (
    ExcitationResult,
    LightScatter,
    PatchCharging,
    PatchExcitation,
)
from labrig.results import Series
from tests.analyse.excitation.bench import true_irradiance
from tests.fit.charged_samples import Bench, lvf_windows
from tests.results.made import decay_result


def excitation_result() -> ExcitationResult:
    """Return the excitation of a patch `left`, and of one `right` whose closure is not known."""
    material = read_material("blue-paint")
    bench = Bench(material)
    windows = lvf_windows(np.array([430.0, 480.0, 650.0]))
    through = bench.series("through the filter", windows, (8.0, 64.0), shots=3)
    direct = bench.series("by the lamp itself", np.ones_like(windows), (256.0,), shots=3)
    through.values[0, 0, 0] = math.nan
    (state,) = material.states
    fit = fit_excitation([through, direct], [state.k_r_per_s], [1.0], RelativeSigmas(bench.flicker))
    unknown = replace(fit.states[0], k_r_per_s_sigma=math.inf)
    fit = replace(fit, states=(unknown,))
    whole = Series(
        t_s=np.array([1.0, 5.0]), exposure_s=np.ones(2), values=np.ones((2, 3)),
        sigma=np.full((2, 3), math.nan), dark_sigma=np.zeros(3), channels=("R", "G", "B"),
        iso=np.full(2, 400.0), f_number=np.full(2, 4.0), frame=("a", "b"), unit=("u", "u"),
        flag=("", "late"),
    )  # fmt: skip
    closed = closure(
        [8.0, 64.0, 256.0], [1.0, 2.0, 3.0], [0.1, 0.1, 0.1], irradiance=[1.0],
        k_e_per_s=[[0.01]], k_r_per_s=[0.03], full_level=[10.0],
    )  # fmt: skip
    charging = PatchCharging(through, direct, np.ones(3), whole)
    decay, light = decay_result((0.03, 10.0)), LightScatter(0.003, 0.2, 0.005)
    patch = PatchExcitation(charging, decay, fit, light, material, closed)
    untested = PatchExcitation(charging, decay, fit, light, material, None)
    return ExcitationResult(
        irradiance=true_irradiance(),
        patches={"left": patch, "right": untested},
        warnings=as_warnings(["odd"]),
    )
