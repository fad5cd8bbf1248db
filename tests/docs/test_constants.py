"""Pages of the manual state the constants that the code has."""

import math

import pytest

from labrig.acquire.roles import camera
from labrig.bench import execution, guard
from labrig.fit import luminance
from labrig.fit.decay import (
    envelope,
    fit_warnings,
    further_state,
    rate_spectrum,
    selection,
    series,
    states,
    variable_projection,
)
from labrig.foundation.detection import STRONG_EVIDENCE_DELTA_BIC
from labrig.material.reradiation import noise
from labrig.protocols.excitation.analysis import lamp_light
from labrig.setup import check
from tests.acceptance.campaigns import ROOT

BLUE_MS, RED_MS = (1000 * tau_s for tau_s in lamp_light.USUAL_1_E_S)
BLUE_NM, RED_NM = lamp_light.USUAL_NM
STATED = {
    "explanation/calibrations.md": [
        f"1/e after {BLUE_MS:.0f} ms at {BLUE_NM:.0f} nm and {RED_MS:.0f} ms at {RED_NM:.0f} nm, "
        f"dark after {1000 * lamp_light.DARK_S:.0f} ms",
    ],
    "explanation/decay_fit.md": [
        f"It is bounded by {100 * envelope.MAX_FLICKER:.0f} %; larger",
        f"probability of {100 * envelope.PRIOR_OF_CONSTANT:.0f} % that the noise is constant",
        f"a grid of rates, at most {variable_projection.COMBINATIONS},",
        f"searched from 1/{series.SLOWEST_SPANS:.0f} of the inverse length",
        f"improbable at the level {selection.F_TEST_LEVEL:g}",
        f"known to {100 * states.ILL_DETERMINED:.0f} % or better. A fall of BIC by more than "
        f"{selection.REFUTING_BIC:.0f} (odds of "
        f"{round(math.exp(selection.REFUTING_BIC / 2), -1):.0f} : 1)",
        f"when a step gains less than {states.CANDIDATE_GAIN:g} in",
        f"prior odds of a fast state are 1 : {1 / further_state.PRIOR_ODDS:.0f}, and $a$ has a "
        f"half-normal prior whose scale is {100 * further_state.USUAL_SHARE:.0f} % of all",
        f"Where $P > 1/{1 / further_state.POSSIBLE:.0f}$,",
        f"Where $P > 1/{1 / further_state.LIKELY:.0f}$, a",
        f"$\\beta$ is more than {fit_warnings.BEND_SIGMAS:.0f} σ from zero",
        f"on a grid of {rate_spectrum.RATES} rates",
        f"better by more than {selection.PREFERRED_BIC:.0f} in BIC",
        f"must be better by {selection.THREE_BIC:.0f} themselves",
        f"better by more than {STRONG_EVIDENCE_DELTA_BIC:.0f} "
        f"(odds of {round(math.exp(STRONG_EVIDENCE_DELTA_BIC / 2), -1):.0f} to 1)",
    ],
    "how-to/dark_room.md": [
        f"Its limit is {100 * check.LIGHT:g} % of the range in {camera.LONG_S:.0f} s",
        f"goes on trying for {guard.TRIES_FOR_S / 60:.0f} min. If labrig hangs or is stopped for "
        f"{guard.HANG_TIMEOUT_S} s",
        f"waits for it for up to {execution.COMES_BACK_S / 60:.0f} min",
    ],
    "how-to/fluorescent.md": [
        f"some number is {noise.CLEAR_SIGMAS:.0f} σ above zero and the same numbers of both "
        f"neighbouring columns are {noise.BESIDE_SIGMAS:.0f} σ",
    ],
    "how-to/luminance.md": [
        f"within a factor of {math.exp(luminance.NEAR):.1f} in time",
    ],
}


@pytest.mark.parametrize(
    ("page", "text"), [(page, text) for page, texts in STATED.items() for text in texts]
)
def test_a_page_states_it(page: str, text: str) -> None:
    words = (ROOT / "docs" / page).read_text(encoding="utf-8").split()
    assert text in " ".join(words)
