"""`labrig explain`: keys, codes of warnings and terms, by one name each."""

import pytest

from labrig.explain import explain
from labrig.foundation.errors import UsageError


def test_a_key_has_value_default_and_meaning_in_every_file_that_has_it() -> None:
    places = {each.place: each for each in explain("every")}
    decay = places["protocol file, protocol: decay"]
    facts = {"value": "duration with unit", "default": "5 s", "referred to by": "for, until"}
    assert dict(decay.facts) == facts
    assert "Time between the begins of two photographs" in decay.text
    assert "protocol file, protocol: blank" in places


def test_a_key_names_those_that_depend_on_it() -> None:
    (grows,) = {dict(each.facts)["referred to by"] for each in explain("exposure")}
    assert grows == "grow_at_most"
    assert all("referred to by" not in dict(each.facts) for each in explain("grow_at_most"))


def test_a_code_has_its_kind_and_its_sentence() -> None:
    (late,) = explain("FRAMES-LATE")
    assert (late.kind, late.place) == ("warning", "disturbance")
    assert dict(late.facts)["sentence"].startswith("{count} frames began late, {latest}")


def test_a_term_is_plain_text() -> None:
    term = next(each for each in explain("amplitude") if each.kind == "term")
    assert "Λ_i k_r,i r_i(0)" in term.text
    assert not {"$", "`", "\\", "{term}"} & set(term.text)


@pytest.mark.parametrize(
    ("symbol", "term"),
    [("k_r", "re-radiation rate"), ("k_e", "excitation rate"), ("r(0)", "concentration")],
)
def test_a_symbol_is_explained_as_its_term(symbol: str, term: str) -> None:
    texts = {each.text for each in explain(symbol)}
    assert {each.text for each in explain(term) if each.kind == "term"} <= texts
    assert not {"{", "}", "^"} & set("".join(texts))


def test_an_unknown_name_has_a_near_one() -> None:
    with pytest.raises(UsageError, match="did you mean 'every'"):
        explain("evry")
