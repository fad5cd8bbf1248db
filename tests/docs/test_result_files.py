"""The manual has every key of the files of results, and none that is in none of them."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from labrig.fit import fit_decay

ROOT = Path(__file__).parents[2]
#: Keys below which names are those of channels, charges or parameters.
NAMED = {"channel_weights", "channel_weights_sigma", "offsets", "offsets_sigma", "levels"}
#: Keys of each interval; a fit may have none.
INTERVAL = ("value", "interval_68", "interval_95", "possible")


def documented(file: str) -> set[str]:
    page = (ROOT / "docs/reference/result_files.md").read_text("utf-8")
    (section,) = re.findall(rf"^## `{re.escape(file)}`.*?(?=^## |\Z)", page, re.M | re.S)
    rows = re.findall(r"^\| (`.*?) \|", section, re.M)
    return {key for row in rows for key in re.findall(r"`(.*?)`", row)}


def keys(content: object, prefix: str = "") -> Iterator[str]:
    if isinstance(content, dict) and content:
        is_named = prefix.rsplit(".", 1)[-1] in {*NAMED, "parameters", "intervals"}
        for name, value in content.items():
            yield from keys(value, f"{prefix}.{'*' if is_named else name}".lstrip("."))
    elif prefix.rsplit(".", 1)[-1] == "warnings":
        yield prefix
    elif isinstance(content, list) and content and isinstance(content[0], dict):
        for entry in content:
            yield from keys(entry, f"{prefix}[]")
    elif prefix.rsplit(".", 1)[-1] == "intervals":
        yield from (f"{prefix}.*.{key}" for key in INTERVAL)
    else:
        yield prefix


def a_fit_without_sigma() -> object:
    t_s = np.linspace(0.5, 200, 60)
    noise = np.random.default_rng(1).standard_normal(len(t_s))
    return fit_decay(t_s, 1000 * np.exp(-0.03 * t_s) + noise, None).to_dict()


@pytest.mark.parametrize(
    ("file", "kept"),
    [("fit.json", "decay/fit.json"), ("excitation.json", "excitation/excitation.json")],
)
def test_every_key_is_explained(file: str, kept: str) -> None:
    contents = [json.loads((ROOT / "tests/recordings/chain/result" / kept).read_text("utf-8"))]
    if file == "fit.json":
        contents.append(a_fit_without_sigma())
    found = {key for content in contents for key in keys(content)}
    assert found == documented(file)
