"""Explanation of a key, a warning's code or a term: `labrig explain NAME`.

Keys come from the schemas of the files, codes and terms from the manual's own pages, so that
terminal and manual say the same.
"""

import ast
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path
from typing import Literal

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import read_text
from labrig.foundation.result_warning import ResultWarning
from labrig.foundation.yaml_file import did_you_mean

_TERM = re.compile(r"\{term\}`([^`<]+?)(?: <[^`>]+>)?`|\{doc\}`/?([^`]+)`|`([^`]+)`")
#: Formats of the values in a sentence.
_FORMATS = re.compile(r"\{(\w+)[^{}]*\}")
#: Commands of formulae that the glossary uses, as a terminal shows them.
_LETTERS = {
    r"\lambda": "λ", r"\Lambda": "Λ", r"\chi": "χ", r"\sigma": "σ", r"\kappa": "κ", r"\tau": "τ",
    r"\beta": "β", r"\Delta": "Δ", r"\Phi": "Φ", r"\ln": "ln", r"\cdot": "·", r"\,": " ",
    r"\le": "≤", r"\ge": "≥", r"\approx": "≈", r"\sum": "Σ", "^2": "²",
}  # fmt: skip


@dataclass(frozen=True)
class Explanation:
    """Explanation of one name.

    Attributes
    ----------
    kind
        Kind of name: a `key` of a file, a `warning`, or a `term` of the glossary.
    name
        The name.
    place
        File and block of a key, kind of a warning; empty for a term.
    text
        Meaning, in whole sentences.
    facts
        Value and default of a key, and the keys whose meaning refers to it.
    """

    kind: Literal["key", "warning", "term"]
    name: str
    place: str
    text: str
    facts: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        """Return the explanation as a paragraph with a heading."""
        place = f" ({self.place})" if self.place else ""
        facts = [f"  {name}: {value}" for name, value in self.facts]
        return "\n".join([f"{self.kind} {self.name}{place}", f"  {self.text}", *facts])


def explain(name: str) -> list[Explanation]:
    """Return the explanations of a name: keys of all files, warnings, and terms.

    Parameters
    ----------
    name
        A key such as `exposure`, a code such as `frames-late`, or a term such as `dark frame`.

    Raises
    ------
    UsageError
        Nothing has that name.

    Examples
    --------
    >>> from labrig.explain import explain
    >>> for each in explain("frames-late"):
    ...     print(each.kind, each.place)
    warning disturbance
    >>> [each.place for each in explain("every")][:1]
    ['protocol file, protocol: decay']
    """
    entries = list(_all())
    wanted = name.strip().lower()
    matches = [each for each in entries if each.name.lower() == wanted]
    if not matches:
        names = sorted({each.name for each in entries})
        raise UsageError(
            f"expected a key of a file, the code of a warning or a term, got '{name}'; "
            f"{did_you_mean(name, names)}"
        )
    depending = _depending(name.strip(), entries)
    return [replace(each, facts=(*each.facts, *depending)) for each in matches]


def _depending(name: str, entries: Sequence[Explanation]) -> list[tuple[str, str]]:
    """Return the keys whose meaning refers to a key, as a fact; none where there are none."""
    refers = re.compile(rf"`(?:\w+\.)*{re.escape(name)}(?:[:.=][^`]*)?`")
    keys = [each.name for each in entries if each.kind == "key" and refers.search(each.text)]
    others = sorted(set(keys) - {name})
    return [("referred to by", ", ".join(others))] if others else []


def _all() -> Iterator[Explanation]:
    from labrig.schema import KINDS
    from labrig.schema_keys import key_blocks

    yield from _terms(read_text(resources.folder("docs") / "glossary.md"))
    yield from _warnings(read_text(resources.folder("docs") / "reference" / "warnings.md"))
    for kind in KINDS:
        for block in key_blocks(kind):
            place = f"{kind} file, {block.title}".removesuffix(", The file")
            for key in block.keys:
                default = "required" if key.is_required else key.default or "none"
                facts = (("value", key.value), ("default", default))
                yield Explanation("key", key.name, place, key.meaning or "–", facts)


def _terms(page: str) -> Iterator[Explanation]:
    """Yield the terms of the glossary, whose texts are indented."""
    body = page.partition("```{glossary}\n")[2].partition("\n```")[0]
    for entry in re.split(r"\n\n(?=\S)", body):
        lines = entry.strip().splitlines()
        names = list(takewhile(lambda line: not line.startswith(" "), lines))
        text = _plain("\n".join(lines[len(names) :]))
        yield from (Explanation("term", name, "", text) for name in names)


def _warnings(page: str) -> Iterator[Explanation]:
    """Yield the warnings of the reference page, a table for each kind."""
    kind = meaning = ""
    for line in page.splitlines():
        if line.startswith("## "):
            kind, meaning = line[3:].lower(), ""
        elif line and not line.startswith("|"):
            meaning = line
        elif row := re.fullmatch(r"\| `([\w-]+)` \| (.*) \|", line):
            sentences = row[2].replace("\\|", "|").split("<br>")
            facts = tuple(("sentence", sentence) for sentence in sentences)
            yield Explanation("warning", row[1], kind, meaning, facts)


def _plain(text: str) -> str:
    """Return Markdown of the glossary as a terminal shows it, in one paragraph."""
    text = re.sub(r"\\mathrm\{(.*?)\}", r"\1", text).replace("^{-1}", "⁻¹")
    for command, letter in _LETTERS.items():
        text = text.replace(command, letter)
    text = re.sub(r"_\{(.*?)\}", r"_\1", text)
    text = _TERM.sub(lambda match: next(filter(None, match.groups())), text)
    return " ".join(text.replace("$", "").replace("*", "").split())


@dataclass(frozen=True)
class WarningText:
    """Sentences of one warning, as they stand in the code.

    Attributes
    ----------
    kind
        Kind of limit.
    code
        Its code.
    sentences
        Its sentences, with the names of their values in braces.
    """

    kind: str
    code: str
    sentences: tuple[str, ...]


def warning_texts(roots: Iterable[Path]) -> list[WarningText]:
    """Collect the warnings that code gives, from its syntax trees, by kind and code.

    Parameters
    ----------
    roots
        Folders of the code.
    """
    kinds = {each.__name__: each.kind for each in ResultWarning.__subclasses__()}
    texts: dict[tuple[str, str], list[str]] = {}
    for path in sorted(path for root in roots for path in root.rglob("*.py")):
        tree = ast.parse(read_text(path))
        for node in ast.walk(tree):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
                continue
            if node.func.id in kinds and len(node.args) >= 2:
                code, sentence = (ast.literal_eval(each) for each in node.args[:2])
                sentence = _FORMATS.sub(r"{\1}", sentence)
                sentences = texts.setdefault((kinds[node.func.id], code), [])
                if sentence not in sentences:
                    sentences.append(sentence)
    return [WarningText(*key, tuple(sentences)) for key, sentences in sorted(texts.items())]
