"""Where the rate equation fails: a real phosphor charged under constant light."""

import pytest

from tests.acceptance import sao_charge_and_decay as sao


@pytest.mark.usefixtures("shared_data")
def test_a_convex_charge_is_none_of_the_rate_equation() -> None:
    t_s, glow, dark = sao.measured()
    early, later = sao.convexity(t_s, glow)
    assert later > 1.3 * early > 0
    one, two = (sao.fitted(states, t_s, glow, dark) for states in (1, 2))
    assert two.chi2 < one.chi2 / 3
    assert two.reduced_chi2 > 5, "two states do not describe it either, and say so"
    begin, rest, *_ = sao.misfits(two, t_s, glow)
    assert begin > 2 * rest
