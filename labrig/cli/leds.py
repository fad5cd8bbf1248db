"""`labrig leds`: LEDs that a bench for fluorescent materials needs."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.material import Corrected, checked, read_fractions
from labrig.cli.screen import echo
from labrig.foundation.errors import DataError, UsageError

if TYPE_CHECKING:
    from labrig.fit.fluorescence import LedSet
    from labrig.material import ReradiationMatrix

#: Numbers of LEDs, lights, and camera unless others are asked for.
NUMBERS, LIGHTS, CAMERA = "6 9 12", ("D65", "A", "395nm"), "canon_eos_5d_mark_ii"
#: Largest number of matrices that are used unless all are asked for: half a minute.
MOST = 6

app = typer.Typer(help="LEDs for fluorescent materials.", no_args_is_help=True)


@app.callback()
def leds() -> None:
    """LEDs for fluorescent materials."""


@app.command("study")
def study(
    matrices: Annotated[
        list[str] | None,
        typer.Argument(
            help="Measured re-radiation matrices, files or folders of them, in any format that "
            "labrig reads; without any, the shipped materials, which are made up."
        ),
    ] = None,
    number: Annotated[
        str,
        typer.Option("--number", help="Numbers of LEDs, such as '6 9 12'."),
    ] = NUMBERS,
    leds: Annotated[
        list[str] | None,
        typer.Option(
            "--leds", help="Peaks in nm of a set of your own, such as '370 390 420'. Repeatable."
        ),
    ] = None,
    camera: Annotated[
        str, typer.Option("--camera", help="Curves of the camera: a shipped name, or a file.")
    ] = CAMERA,
    light: Annotated[
        list[str] | None,
        typer.Option(
            "--light",
            help="A CIE illuminant, a narrow light such as 450nm, or a file with a spectrum. "
            f"Repeatable; default: {', '.join(LIGHTS)}.",
        ),
    ] = None,
    corrected: Corrected = False,
    every: Annotated[
        bool,
        typer.Option(
            "--all", help=f"Use all matrices; without it {MOST} of them, which takes half a minute."
        ),
    ] = False,
    search: Annotated[
        bool,
        typer.Option(
            "--search",
            help="Also move the LEDs of each number by 10 nm as long as that lowers the error of "
            "these matrices; takes minutes to hours.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for led_study.json, the page and its figures."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print led_study.json.")] = False,
) -> None:
    """Study how well LEDs of some number and placement estimate known fluorescent materials.

    Matrices are photographed under the LEDs by a simulation, estimated, and compared with
    themselves: recommended and evenly spaced LEDs, and your own.
    """
    from labrig.fit.fluorescence import (
        RECOMMENDED_NM,
        even_peaks_nm,
        moved_leds,
        require_peaks,
        study_set,
    )
    from labrig.foundation.activity import counted
    from labrig.optics import read_camera, read_light
    from labrig.report import ComparedLeds, describe_leds

    if out is not None and out.is_file():
        raise UsageError(f"--out: expected a folder, got the file {out}; give another path")
    lights = [read_light(name) for name in light or LIGHTS]
    response = read_camera(camera)
    numbers = _numbers("--number", number)
    own = [_numbers("--leds", text) for text in leds or ()]
    wanted: list[tuple[str, tuple[float, ...]]] = []
    for count in numbers:
        if count != int(count):
            raise UsageError(f"--number: expected whole numbers such as '6 9 12', got '{number}'")
        if int(count) in RECOMMENDED_NM:
            wanted.append(("recommended", RECOMMENDED_NM[int(count)]))
        wanted.append(("even", even_peaks_nm(int(count))))
    wanted += [("given", peaks_nm) for peaks_nm in own]
    for _, peaks_nm in wanted:
        require_peaks(peaks_nm)
    surfaces, of_surfaces = _surfaces(matrices or [], corrected, every)
    sets: list[LedSet] = []
    for placement, peaks_nm in counted(wanted, "judging sets of LEDs"):
        sets.append(study_set(placement, peaks_nm, response, surfaces, lights))
    if search:
        best = {len(one.peaks_nm): one for one in sorted(sets, key=lambda one: -one.judged)}
        for start in counted(list(best.values()), "searching for better LEDs"):
            *_, found = (
                start,
                *moved_leds(start, lambda nm: study_set("found", nm, response, surfaces, lights)),
            )
            if found is not start:
                sets.append(found)
    sets.sort(key=lambda one: len(one.peaks_nm))
    compared = ComparedLeds(tuple(sets), response.name, of_surfaces)
    if as_json:
        typer.echo(compared.to_json())
    else:
        echo(describe_leds(compared))
    if out is None:
        return
    from labrig.process import report_led_study

    command = ["labrig", "leds", "study", *(matrices or []), "--number", number]
    command += [word for text in leds or () for word in ("--leds", text)]
    command += [word for name in light or () for word in ("--light", name)]
    command += ["--camera", camera] if camera != CAMERA else []
    flags = {"--corrected": corrected, "--all": every, "--search": search}
    command += [flag for flag, is_set in flags.items() if is_set]
    report = report_led_study(compared, shlex.join(command), out)
    if not as_json:
        echo(f"report: {report}")


def _numbers(option: str, text: str) -> tuple[float, ...]:
    """Return the numbers in a text, separated by blanks or commas."""
    words = text.replace(",", " ").split()
    try:
        numbers = tuple(float(word) for word in words)
    except ValueError:
        numbers = ()
    if not numbers or not all(0 < value < 1e4 for value in numbers):
        raise UsageError(f"{option}: expected numbers such as '6 9 12', got '{text}'")
    return tuple(dict.fromkeys(numbers))


def _surfaces(
    matrices: list[str], is_corrected: bool, is_all: bool
) -> "tuple[list[ReradiationMatrix], str]":
    """Return matrices, and words on what they are."""
    from labrig.foundation import resources

    kind = "measured matrices"
    if not matrices:
        matrices, kind = sorted(resources.names("config/fluorescent")), "shipped materials"
        echo(
            f"note: no matrices are named, so the {len(matrices)} shipped materials are taken, "
            "which are made up; give measured ones to choose LEDs by",
            err=True,
        )
    files = [file for name in matrices for file in _files(name)]
    if not files:
        raise UsageError(f"{', '.join(matrices)}: expected re-radiation matrices, got no such file")
    if len(files) > MOST and not is_all:
        chosen = [files[index * len(files) // MOST] for index in range(MOST)]
        echo(f"note: {MOST} of {len(files)} matrices are used; --all uses all", err=True)
        files, kind = chosen, f"{kind} of {len(files)}"
    surfaces = [checked(file, read_fractions(file), is_corrected) for file in files]
    for file, surface in zip(files, surfaces, strict=True):
        _require_usable(file, surface)
    return surfaces, f"{len(surfaces)} {kind}"


def _files(name: str) -> list[str]:
    from labrig.material import matrix_files

    return [str(path) for path in matrix_files(Path(name))] if Path(name).is_dir() else [name]


def _require_usable(file: str, surface: "ReradiationMatrix") -> None:
    import numpy as np

    if np.isnan(surface.reflectance).all():
        raise DataError(f"{file}: expected a measured reflectance, which a colour needs; got none")
