"""What a paper would say of how this was measured: only what is true of the run."""

from collections.abc import Iterator
from dataclasses import dataclass

from labrig.report.content import DecayReport
from labrig.report.photographs import Sensor
from labrig.report.recording_text import listed, recording
from labrig.report.timing import Lateness
from labrig.results import FittedDecay
from labrig.written_numbers import rounded

EQUATION_LATEX = (
    r"s_c(t, T) = w_c \sum_{i=1}^{n} a_i \, e^{-k_i t} \, \frac{1 - e^{-k_i T}}{k_i T} + b_c"
)
REFERENCES = (
    "O. Nalbach, H.-P. Seidel, T. Ritschel: Practical Capture and Reproduction of Phosphorescent "
    "Appearance. Computer Graphics Forum 36(2), 409–420, 2017. doi:10.1111/cgf.13136",
    "C. R. Harris et al.: Array programming with NumPy. Nature 585, 357–362, 2020. "
    "doi:10.1038/s41586-020-2649-2",
    "P. Virtanen et al.: SciPy 1.0: fundamental algorithms for scientific computing in Python. "
    "Nature Methods 17, 261–272, 2020. doi:10.1038/s41592-019-0686-2",
)
#: What a paper should say and labrig cannot know.
UNKNOWN = (
    "the lamp's type, power and distance",
    "the lens and the camera's distance",
    "the sample's temperature",
)
#: As they are called in papers, and with their reference.
_SOFTWARE = {"numpy": "NumPy {} [2]", "scipy": "SciPy {} [3]", "libraw": "LibRaw {}"}


@dataclass(frozen=True)
class Methods:
    """Paragraphs of plain text; the equation stands after `model`, which is empty without a fit."""

    recording: str
    model: str
    analysis: str

    @property
    def plain(self) -> str:
        """All of it, to be pasted; the equation as LaTeX."""
        references = [f"[{number}] {text}" for number, text in enumerate(REFERENCES, start=1)]
        equation = f"\\begin{{equation}}\n  {EQUATION_LATEX}\n\\end{{equation}}"
        fitted = [self.model, equation] if self.model else []
        return "\n\n".join([self.recording, *fitted, self.analysis, "\n".join(references)])


def methods(report: DecayReport, sensor: Sensor | None, late: Lateness | None) -> Methods:
    """Of the run in `report`, with its camera and the lateness of its frames where known."""
    fits = [patch.fit for patch in report.patches if isinstance(patch.fit, FittedDecay)]
    software = list(_software(report))
    return Methods(
        recording=" ".join(recording(report, sensor, late)),
        model=_model(report) if fits else "",
        analysis=" ".join([*(_analysis(report, fits) if fits else ()), *software]),
    )


def _model(report: DecayReport) -> str:
    channel = "" if len(report.patches[0].series.channels) == 1 else " in channel c"
    return (
        f"The signal{channel} of an exposure from t to t + T after lamp off was modelled, after "
        "Nalbach et al. [1], as a sum of n exponential decays, each averaged over the exposure:"
    )


def _analysis(report: DecayReport, fits: list[FittedDecay]) -> Iterator[str]:
    offset = (
        "an offset b_c, which the uncertainty of the dark level restrains"
        if any(any(fit.offsets_sigma) for fit in fits)
        else "no offset, b_c = 0"
    )
    if len(fits[0].channels) > 1:
        yield (
            "The rates k_i and the amplitudes a_i are common to all channels; each channel has a "
            f"weight w_c, which is 1 for the brightest, and {offset}."
        )
    else:
        yield f"Here k_i are the rates and a_i the amplitudes; there are w_c = 1 and {offset}."
    yield "All parameters were fitted together by weighted nonlinear least squares."
    yield f"The weights follow the photon and reading noise found in the frames{_flicker(fits)}."
    states = [str(one) for one in sorted({fit.n_states for fit in fits})]
    number = f"n = {states[0]}" if len(states) == 1 else f"n = {' or '.join(states)} by patch"
    if report.states is not None:
        yield f"The number of states was set to {report.states}."
    else:
        yield (
            f"The number of states, {number}, was chosen by the Bayesian information criterion "
            "and an F-test."
        )
    rivals = list(dict.fromkeys(rival.name for fit in fits for rival in fit.rivals))
    if rivals:
        yield f"For comparison, a {listed(rivals).replace(' and ', ' and a ')} were fitted."
    yield "Uncertainties are standard uncertainties (1 σ) from the covariance of the fit."


def _flicker(fits: list[FittedDecay]) -> str:
    """Patches of a frame share their flicker, so that the one which knows it best tells it."""
    measured = [fit for fit in fits if fit.flicker_sigma > 0]
    best = min(measured, key=lambda fit: fit.flicker_sigma, default=fits[0])
    if best.flicker == 0:
        return ""
    source = "as their scatter about the decay shows" if measured else "an assumption"
    percent = rounded(100 * best.flicker, 2)
    return f" and a flicker of {percent} % that the channels of a frame share, {source}"


def _software(report: DecayReport) -> Iterator[str]:
    versions = dict(report.about.libraries)
    used = [text.format(versions[name]) for name, text in _SOFTWARE.items() if name in versions]
    with_them = f" with {listed(used)}" if used else ""
    yield f"Recording and analysis were done by labrig {report.about.labrig_version}{with_them}."
