"""A person's YAML with new patches: everything else stays byte for byte."""

from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from labrig.acquire import read_protocol
from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.yaml_file import parse_yaml
from labrig.setup.patches_block import rounded, with_patches, write_patches

TWO = {"blue paint": (0.1, 0.2, 0.3, 0.4), "glove": (0.5, 0.0, 0.25, 1.0)}
BLOCK = '  "blue paint": [0.1, 0.2, 0.3, 0.4]\n  glove: [0.5, 0, 0.25, 1]\n'

CASES = {
    "block": (
        "a: 1  # one\npatches:  # where\n  # inside\n  x: [0, 0, 1, 1]\n# below\n\nb: 2\n",
        f"a: 1  # one\npatches:  # where\n  # inside\n{BLOCK}# below\n\nb: 2\n",
    ),
    "flow with a comment": (
        "patches: {x: [0, 0, 1, 1]}  # here\nb: 2\n",
        f"patches:  # here\n{BLOCK}b: 2\n",
    ),
    "flow over lines": ("patches: {x: [0, 0,\n  1, 1]}\nb: 2", f"patches:\n{BLOCK}b: 2"),
    "flow below": ("patches:\n  {x: [0, 0, 1, 1]}\nb: 2", f"patches:\n{BLOCK}b: 2"),
    "lists as blocks": (
        "patches:\n  x:\n  - 0\n  - 0\n  - 1\n  - 1\nb: 2\n",
        f"patches:\n{BLOCK}b: 2\n",
    ),
    "nothing yet": ("patches:\nb: 2\n", f"patches:\n{BLOCK}b: 2\n"),
    "null": ("patches: null # none\nb: 2\n", f"patches: # none\n{BLOCK}b: 2\n"),
    "quoted key": ('"patches" : {}\nb: 2\n', f'"patches":\n{BLOCK}b: 2\n'),
    "no key": ("a: 1 # one\n# end\n", f"a: 1 # one\n# end\npatches:\n{BLOCK}"),
    "no key, no end of line": ("a: 1", f"a: 1\npatches:\n{BLOCK}"),
    "no key, document marks": ("---\na: 1\n...\n", f"---\na: 1\npatches:\n{BLOCK}...\n"),
    "no key, text at the end": ("a: |\n  text", f"patches:\n{BLOCK}a: |\n  text"),
    "last": ("b: 2\npatches: {}", f"b: 2\npatches:\n{BLOCK}"),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_only_the_patches_change(case: tuple[str, str]) -> None:
    before, after = case
    assert with_patches(before, TWO, "file").rstrip("\n") == after.rstrip("\n")


def test_the_ends_of_lines_stay_as_they_are() -> None:
    text = "a: 1\r\npatches:\r\n  x: [0, 0, 1, 1]\r\nb: 2\r\n"
    assert with_patches(text, TWO, "file") == f"a: 1\npatches:\n{BLOCK}b: 2\n".replace("\n", "\r\n")


@pytest.mark.parametrize(
    "text",
    [
        "{a: 1, patches: {x: [0, 0, 1, 1]}}",
        "patches: {x: &r [0, 0, 1, 1]}\nbackground: *r\n",
        "background: &r {x: 1}\npatches: *r\n",
    ],
)
def test_what_cannot_be_changed_alone_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"write it by hand: .*glove: \[0.5, 0, 0.25, 1\]"):
        with_patches(text, TWO, "file")


comments = st.text(st.characters(min_codepoint=32, max_codepoint=0x2FF, exclude_categories=["C"]))
lines = st.one_of(
    st.just(""),
    comments.map(lambda text: f"# {text}"),
    comments.map(lambda text: f"  # {text}"),
)
names = st.text(
    st.characters(min_codepoint=32, max_codepoint=0xFFFF, exclude_categories=["C", "Z"]),
    min_size=1,
    max_size=12,
)
values = st.sampled_from(
    ["1", "1e-3", "90 min", "[1, 2]  # list", "{a: 1}", "'it''s'", "no", "|\n  two\n  lines", "~"]
)
fractions = st.floats(0.001, 0.5)
regions = st.tuples(fractions, fractions, fractions, fractions)
old_patches = st.sampled_from(
    [None, "", " {}", " {x: [0, 0, 1, 1]}  # why", "\n  x: [0, 0, 1, 1]\n  y: [0, 0, 1, 1]  # z"]
)


@given(
    st.lists(st.tuples(lines, values), max_size=4),
    old_patches,
    st.lists(st.tuples(lines, values), max_size=4),
    st.dictionaries(names, regions, min_size=1, max_size=4),
    st.booleans(),
)
def test_all_that_surrounds_the_patches_survives(
    before: list[tuple[str, str]],
    old: str | None,
    after: list[tuple[str, str]],
    patches: dict[str, tuple[float, float, float, float]],
    ended: bool,
) -> None:
    head = "".join(f"{line}\nkey{n}: {value}\n" for n, (line, value) in enumerate(before))
    tail = "".join(f"{line}\nnext{n}: {value}\n" for n, (line, value) in enumerate(after))
    tail += "last: 1\n"
    text = head + ("" if old is None else f"patches:{old}\n") + tail
    text = text if ended else text[:-1]
    changed = with_patches(text, patches, "file")
    assert changed.startswith(head)
    assert tail.rstrip("\n") in changed
    content = parse_yaml(changed, "file")
    wanted = {name: list(rounded(region)) for name, region in patches.items()}
    assert content.pop("patches") == wanted
    expected = parse_yaml(text, "file")
    expected.pop("patches", None)
    assert repr(content) == repr(expected)
    assert with_patches(changed, patches, "file") == changed


def test_a_shipped_protocol_is_written_and_still_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    text = resources.find("protocols", "protocol", "decay").read_text()
    path.write_text(text)
    write_patches(path, TWO)
    assert path.read_text() == text.replace("  sample: [0.3, 0.3, 0.4, 0.4]\n", BLOCK)
    assert read_protocol(path).model_dump()["patches"] == TWO
    assert [p.name for p in tmp_path.iterdir()] == ["mine.yaml"]


def test_a_protocol_that_would_be_refused_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("protocol: decay\ncharge: 1\n")
    with pytest.raises(UsageError, match=r"mine\.yaml: charge") as caught:
        write_patches(path, TWO)
    assert "trial" not in str(caught.value)
    assert path.read_text() == "protocol: decay\ncharge: 1\n"
    assert [p.name for p in tmp_path.iterdir()] == ["mine.yaml"]


@given(regions)
def test_rounded_regions_stay_in_the_frame(region: tuple[float, float, float, float]) -> None:
    x, y, width, height = rounded(region)
    assert 0 <= x <= x + width <= 1
    assert 0 <= y <= y + height <= 1
