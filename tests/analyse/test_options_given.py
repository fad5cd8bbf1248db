"""Options of one processing against those of the one before: which are dropped without a word."""

from typing import Any

import pytest

from labrig.analyse import Overrides

BEFORE = Overrides.parse(
    ["left=0.1,0.1,0.2,0.2", "right=0.5,0.1,0.2,0.2"], ["20", "21"], "canon_eos_5d_mark_ii",
    [], {"states": 2, "rate": (0.2, 0.3), "intervals": True},
).given()  # fmt: skip


def test_options_stand_as_on_a_command_line() -> None:
    assert (
        *("--roi left=0.1,0.1,0.2,0.2", "--roi right=0.5,0.1,0.2,0.2"),
        *("--exclude 20", "--exclude 21", "--camera canon_eos_5d_mark_ii"),
        *("--states 2", "--rate 0.2", "--rate 0.3", "--intervals"),
    ) == BEFORE
    assert Overrides().given() == ()


@pytest.mark.parametrize(
    ("regions", "excluded", "options", "kept"),
    [
        ([], [], {}, ()),
        (["left=0,0,0.3,0.3"], [], {}, ("--roi left",)),
        ([], ["21"], {}, ("--exclude 21",)),
        ([], [], {"states": 3, "rate": (0.1,)}, ("--states", "--rate")),
    ],
)
def test_what_is_neither_given_again_nor_replaced_is_not_kept(
    regions: list[str], excluded: list[str], options: dict[str, Any], kept: tuple[str, ...]
) -> None:
    now = Overrides.parse(regions, excluded, options=options)
    assert now.not_kept(BEFORE) == [text for text in BEFORE if not text.startswith(kept or "=")]


def test_the_only_patch_has_no_name() -> None:
    before = Overrides.parse(["0.1,0.1,0.2,0.2"], []).given()
    assert Overrides.parse(["0.3,0.1,0.2,0.2"], []).not_kept(before) == []
    assert Overrides().not_kept(before) == list(before)
