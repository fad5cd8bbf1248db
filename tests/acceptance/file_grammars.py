"""Files by a grammar that breaks its own rules: BFC, ARK, camera curves and linear EXR.

    python -m tests.acceptance.file_grammars [--cases 100000] [--seed 1] [--kind NAME [--case N]]

Every file is written by the rules of its format, of a random size, and then some of them are
broken: a token is another number, a word, an empty one, one that no float has; a line is left out,
repeated, moved or cut; in an EXR attributes, channels, types and bytes of the header. Wanted: a
result whose numbers are all finite, or one refusal in a line that names the file; nothing else, in
less than two seconds.
"""

import argparse
import random
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

import numpy as np
import OpenEXR

from labrig.foundation.errors import LabrigError
from labrig.material import read_reradiation
from labrig.optics import read_camera
from labrig.reproduce import read_linear_exr

MAX_S = 2.0
TOKENS = (
    *("", "0", "-0", "-1", "1e400", "-1e-400", "nan", "NaN", "inf", "-inf", "1e308", "4.9e-324"),
    *("1,5", "1.5.2", "0x10", "1_000", "١٢", "²", "½", "None", "true", "=1+1", "{", "}", "{{", ";"),
    *("\t", '"', "'", "\x00", "\ufeff", "9" * 400, "0." + "0" * 300 + "1", "EOD", "r:c:", "380nm"),
)
_TOKEN = re.compile(r"[^\s,{}:;]+")


@dataclass
class Tally:
    """All cases of one kind of file."""

    read: int = 0
    refusals: Counter[str] = field(default_factory=Counter)
    longest_s: float = 0.0
    wrong: list[str] = field(default_factory=list)


def bfc(rng: random.Random) -> bytes:
    """Return a BFC file."""
    first, step, n_in = rng.choice([300, 350, 400]), rng.choice([5, 10, 20]), rng.randint(2, 8)
    out_first, n_out = rng.choice([300, 380]), rng.randint(2, 8)
    out_last = out_first + step * (n_out - 1)
    lines = ["VEC_01\t5167", "BFC-450 Matrix File", "; comment", "; a sample"]
    lines.append("\t".join(map(str, (out_first, out_last, step, n_in, first, step))))
    lines.append("\t".join(["r:c:", *(str(first + step * k) for k in range(n_in))]))
    for k in range(n_out):
        cells = (f"{rng.uniform(0.0, 0.5 / n_in):.6f}" for _ in range(n_in))
        lines.append("\t".join([str(out_first + step * k), *cells]))
    return "\r\n".join([*lines, "EOD", ""]).encode("iso-8859-1")


def ark(rng: random.Random) -> bytes:
    """Return an archive of one matrix, or of a spectrum and a matrix."""
    n, first, step = rng.randint(2, 8), rng.choice([300, 380, 400]), rng.choice([5, 10])
    lines = ["ART measurement archive", "", "Entry ID: a_matrix", "Entry type: reflectance"]
    lines += [
        "Description : a sample",
        "Type: regular",
        *(
            line
            for axis in ("Reflectance", "Illumination")
            for line in (f"{axis} start: {first} nm", f"{axis} increment: {step} nm")
        ),
        "Maximum sample value: 1.0",
        "ASCII sample data",
        "{",
    ]
    rows = [[rng.uniform(0.0, 0.5 / n) if j <= i else 0.0 for j in range(n)] for i in range(n)]
    texts = ["{" + ", ".join(f"{value:.6f}" for value in row) + "}" for row in rows]
    return "\n".join([*lines, ",\n".join(texts), "}", ""]).encode()


def curves(rng: random.Random) -> bytes:
    """Return the curves of a camera."""
    separator = rng.choice([",", "\t", ";"])
    start, step, n = rng.choice([380, 400]), rng.choice([4, 5, 10]), rng.randint(3, 80)
    lines = [separator.join(("wavelength_nm", "R", "G", "B"))]
    for k in range(n):
        cells = (f"{rng.uniform(0.0, 1.0):.5f}" for _ in range(3))
        lines.append(separator.join((str(start + step * k), *cells)))
    return "\n".join([*lines, ""]).encode()


def broken_text(content: bytes, rng: random.Random) -> bytes:
    """Return a text file of which some rules are broken."""
    lines = content.decode("iso-8859-1").splitlines()
    for _ in range(rng.choice([0, 1, 1, 2, 5])):
        at = rng.randrange(len(lines))
        tokens = list(_TOKEN.finditer(lines[at]))
        match rng.randrange(7):
            case 0 if len(lines) > 1:
                del lines[at]
            case 1:
                lines.insert(at, lines[rng.randrange(len(lines))])
            case 2:
                lines[at] = lines[at][: rng.randint(0, len(lines[at]))]
            case 3:
                lines[at] += rng.choice("\t,;{}\x0b\x85") + rng.choice(TOKENS)
            case 4:
                rng.shuffle(lines)
            case _ if tokens:
                token = rng.choice(tokens)
                word = rng.choice([*TOKENS, str(rng.randint(-(10**6), 10**6)), f"{rng.random():g}"])
                lines[at] = lines[at][: token.start()] + word + lines[at][token.end() :]
    text = rng.choice(["\n", "\r\n", "\r"]).join(lines)
    return text.encode(rng.choice(["iso-8859-1", "utf-8", "utf-16"]), errors="replace")


def exr(rng: random.Random, path: Path) -> None:
    """Write a linear OpenEXR picture of which some rules are broken."""
    height, width = rng.randint(1, 6), rng.randint(1, 6)
    names = rng.choice(
        [["R", "G", "B"]] * 4 + [["R", "G"], ["Y"], ["X", "Y", "Z"], ["R", "G", "B", "A"]]
    )
    kinds = rng.choice([["f4"]] * 3 + [["f2"], ["u4"], ["f4", "f2"]])
    special = rng.choice([0.0, 1.0, np.nan, np.inf, -1.0, 6e4, 3e38])
    channels = {}
    for k, name in enumerate(names):
        values = np.full((height, width), rng.random())
        values[rng.randrange(height), rng.randrange(width)] = special
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            channels[name] = values.astype(kinds[k % len(kinds)])
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    if rng.random() < 0.5:
        header["chromaticities"] = tuple(
            rng.choice([0.64, 0.33, 0.3, 0.6, 0.0, -1.0, 1e30, float("nan")]) for _ in range(8)
        )
    OpenEXR.File(header, channels).write(str(path))
    content = bytearray(path.read_bytes())
    for _ in range(rng.choice([0, 0, 1, 3])):
        near = min(len(content), rng.choice([8, 400, len(content)]))
        content[rng.randrange(near)] = rng.choice([0, 1, 0x7F, 0xFF, rng.randrange(256)])
    if rng.random() < 0.1:
        del content[rng.randrange(len(content)) :]
    path.write_bytes(content)


def _write_text(make: Callable[[random.Random], bytes], ending: str) -> Callable[..., Path]:
    def write(rng: random.Random, folder: Path) -> Path:
        path = folder / f"file{ending}"
        path.write_bytes(broken_text(make(rng), rng))
        return path

    return write


def _write_exr(rng: random.Random, folder: Path) -> Path:
    path = folder / "file.exr"
    exr(rng, path)
    return path


def _numbers_of_matrix(path: Path) -> Iterator[object]:
    matrix = read_reradiation(path)
    yield from (matrix.input_nm, matrix.output_nm)
    for values in (matrix.reradiation, matrix.reflectance):
        yield values[~np.isnan(values)]  # NaN: not measured


def _numbers_of_camera(path: Path) -> Iterator[object]:
    camera = read_camera(path)
    yield from (camera.wavelength_nm, camera.response(np.ones_like(camera.wavelength_nm)))


def _numbers_of_picture(path: Path) -> Iterator[object]:
    yield read_linear_exr(path)


KINDS: dict[str, tuple[Callable[..., Path], Callable[[Path], Iterator[object]]]] = {
    "BFC": (_write_text(bfc, ".txt"), _numbers_of_matrix),
    "ARK": (_write_text(ark, ".ark"), _numbers_of_matrix),
    "camera curves": (_write_text(curves, ".csv"), _numbers_of_camera),
    "linear EXR": (_write_exr, _numbers_of_picture),
}


def try_one(kind: str, rng: random.Random, folder: Path, tally: Tally) -> str:
    """Read one file; return what is wrong, if anything."""
    write, read = KINDS[kind]
    path, began_s = write(rng, folder), perf_counter()
    wrong = ""
    try:
        numbers = list(read(path))
    except LabrigError as error:
        text = str(error)
        tally.refusals[re.sub(r"[\d.]+|'.*'", "…", text.replace(str(folder), ""))[:60]] += 1
        if "\n" in text or path.name not in text:
            wrong = f"refused by {text!r}"
    except Exception as error:
        wrong = repr(error)
    else:
        tally.read += 1
        if not all(np.isfinite(np.asarray(array, dtype=float)).all() for array in numbers):
            wrong = "numbers that are not finite"
    took_s = perf_counter() - began_s
    tally.longest_s = max(tally.longest_s, took_s)
    return wrong or (f"took {took_s:.1f} s" if took_s > MAX_S else "")


def main() -> None:
    """Print a line for each kind of file, and what went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument("--case", type=int, help="only this one of that kind")
    asked = parser.parse_args()
    wrong: list[str] = []
    number = 0
    print(f"{'file':16}{'cases':>8}{'read':>8}{'refusals':>10}{'kinds':>7}{'wrong':>7}  longest")
    warnings.simplefilter("error", RuntimeWarning)  # else a line of numpy's on the terminal
    with tempfile.TemporaryDirectory() as name:
        for kind in [asked.kind] if asked.kind else KINDS:
            tally = Tally()
            cases = range(asked.cases) if asked.case is None else [asked.case]
            for case in cases:
                rng = random.Random(f"{asked.seed} {kind} {case}")
                if said := try_one(kind, rng, Path(name), tally):
                    tally.wrong.append(f"{kind}, case {case}: {said}")
            wrong += tally.wrong
            number += len(cases)
            print(
                f"{kind:16}{len(cases):8}{tally.read:8}{tally.refusals.total():10}"
                f"{len(tally.refusals):7}{len(tally.wrong):7}  {tally.longest_s:.2f} s",
                flush=True,
            )
    print(f"{len(wrong)} of {number} went wrong", *wrong[:20], sep="\n")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
