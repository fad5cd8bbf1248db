"""`labrig render`: measured materials in a scene, over time."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from labrig.cli.completion import complete_scene
from labrig.cli.screen import echo
from labrig.foundation.result_warning import warning_lines

if TYPE_CHECKING:
    from labrig.reproduce import RenderFolder, Scene

#: Memory below which Embree, LLVM and OpenBLAS crash while they are loaded or begin to work.
LIBRARIES_BYTES = 700_000_000


def render(
    scene: Annotated[
        str,
        typer.Argument(
            help="A shipped scene, such as 'cornell-box', or a path to a YAML file.",
            autocompletion=complete_scene,
        ),
    ],
    materials: Annotated[
        list[str] | None,
        typer.Option(
            "--material",
            help="NAME=FILE: another file, or shipped name, for a material; may be given again.",
        ),
    ] = None,
    times: Annotated[
        str | None, typer.Option("--times", help="Times of the pictures in s, such as 0,1,80.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder of the pictures. Default: renders/SCENE.")
    ] = None,
    size: Annotated[
        str | None, typer.Option("--size", help="Size of the pictures, such as 640x480.")
    ] = None,
    paths: Annotated[
        int | None, typer.Option("--paths", min=1, help="Paths for each pixel and texel.")
    ] = None,
    assume_albedo: Annotated[
        float | None,
        typer.Option(
            "--assume-albedo",
            min=0,
            max=0.99,
            help="Albedo of phosphors whose file has none, 0 to below 1.",
        ),
    ] = None,
    assume_scale: Annotated[
        float | None,
        typer.Option(
            "--assume-scale",
            min=1e-9,
            help="Factor from Λ to s/sr of phosphors whose file has no scale.",
        ),
    ] = None,
    exposure: Annotated[
        str | None,
        typer.Option(
            "--exposure",
            help="'each': so that each picture is bright; 'common': one for all; or the luminance "
            "in cd/m² that is white. Default: the scene's.",
        ),
    ] = None,
    white: Annotated[
        str | None,
        typer.Option(
            "--white",
            help="Light in which a white surface looks white, such as D65, D50, A, or a file: "
            "colours are adapted to the screen by Bradford's transform. Default: the scene's.",
        ),
    ] = None,
    night: Annotated[
        bool,
        typer.Option("--night", help="As the eye sees it in the dark (Thompson et al., 2002)."),
    ] = False,
    linear: Annotated[
        bool,
        typer.Option(
            "--linear", help="Each picture as linear sRGB in cd/m² (EXR), for other programs, too."
        ),
    ] = False,
    video: Annotated[
        Path | None, typer.Option("--video", help="File for a film of all pictures (.mp4).")
    ] = None,
    gltf: Annotated[
        Path | None,
        typer.Option(
            "--gltf", help="File for a preview in a browser, with the glow over time (.glb)."
        ),
    ] = None,
    mitsuba: Annotated[
        Path | None,
        typer.Option("--mitsuba", help="Folder for the first picture as a scene of Mitsuba 3."),
    ] = None,
    fps: Annotated[float, typer.Option("--fps", help="Pictures of the film per second.")] = 25.0,
) -> None:
    """Render a scene at its times. The last line is the folder of the pictures.

    A rendering that was interrupted goes on when it is started again.
    """
    from labrig.foundation.activity import activity
    from labrig.foundation.clock import SystemClock
    from labrig.foundation.errors import require_memory
    from labrig.foundation.quantity import duration_text

    require_memory(LIBRARIES_BYTES)
    from labrig.reproduce import (
        Assumptions,
        RenderFolder,
        load_scene,
        require_ffmpeg,
        require_traceable,
        white_under,
    )

    if video is not None:
        require_ffmpeg(video)
    _check_places(gltf, mitsuba)
    built = load_scene(scene, _pairs(materials or []), Assumptions(assume_albedo, assume_scale))
    built = _changed(built, times, size, paths).displayed(white, exposure)
    adapted = None if built.white is None else white_under(built.white, built.bands.edges_nm)
    require_traceable(built)
    for line in warning_lines(built.notes, "note: "):
        echo(line, err=True)
    folder = RenderFolder.open(out or Path("renders") / built.file.name, built)
    done, count = folder.n_done, len(folder.times_s)
    if done:
        echo(f"{done} of {count} pictures are there already", err=True)
    clock = SystemClock()
    begin_s = clock.now()
    with activity("rendering") as work:

        def report(what: str, part: float) -> None:
            if what != work.what:
                work.restart(what, 100)
            work.done = round(100 * part)

        frames = folder.rendered(built, report=report)
        for number, frame in enumerate(frames, done + 1):
            left_s = round((clock.now() - begin_s) / (number - done) * (count - number))
            remaining = f", about {duration_text(left_s)} left" if number < count else ""
            echo(f"picture {number} of {count}, at {frame.t_s:g} s{remaining}", err=True)
            for line in warning_lines(frame.warnings, "warning: "):
                echo(line, err=True)
    _draw(folder, built, night, adapted, video, fps)
    if linear:
        _write_linear(folder)
    _export(folder, built, gltf, mitsuba)
    echo(folder.path)


def _export(
    folder: "RenderFolder", scene: "Scene", gltf: Path | None, mitsuba: Path | None
) -> None:
    """Write the scene for other programs."""
    if gltf is None and mitsuba is None:
        return
    from labrig.reproduce import (
        exported_meshes,
        write_gltf,
        write_mitsuba_scene,
    )

    meshes = exported_meshes(scene, folder)
    for mesh in meshes:
        if mesh.preview is not None:
            echo(f"{mesh.name}: {mesh.preview.statement}", err=True)
    if gltf is not None:
        times_s = [t_s - folder.times_s[0] for t_s in folder.times_s]
        brightest = max(
            (float(each.glow.colour[1:].max(initial=0.0)) for each in meshes if each.glow),
            default=0.0,
        )
        exposure = 1 / brightest if brightest else 1.0
        write_gltf(gltf, meshes, times_s, exposure, scene.camera, up="z")
        echo(f"wrote {gltf}: sRGB of what glows, without light between surfaces", err=True)
    if mitsuba is not None:
        written = write_mitsuba_scene(mitsuba, meshes, scene.camera)
        echo(f"wrote {written}: lamps and glow in sRGB, not re-radiation", err=True)


def _write_linear(folder: "RenderFolder") -> None:
    """Write all frames in linear sRGB."""
    from labrig.reproduce import tristimulus, write_linear_exr

    for number in range(folder.n_done):
        frame = folder.frame(number)
        xyz = tristimulus(frame.radiance, frame.edges_nm)
        write_linear_exr(folder.path / f"{number:03d}-linear.exr", xyz)


def _check_places(gltf: Path | None, mitsuba: Path | None) -> None:
    """Refuse places for exports before a picture is made."""
    from labrig.foundation.errors import UsageError

    if gltf is not None and (gltf.suffix.lower() != ".glb" or not gltf.absolute().parent.is_dir()):
        raise UsageError(f"{gltf}: expected a file that ends in .glb in a folder that is there")
    if mitsuba is not None and mitsuba.exists() and not mitsuba.is_dir():
        raise UsageError(f"{mitsuba}: expected a folder, got a file")


def _pairs(texts: list[str]) -> dict[str, str]:
    from labrig.foundation.errors import UsageError

    pairs = {}
    for text in texts:
        name, is_pair, value = text.partition("=")
        if not (is_pair and name and value):
            raise UsageError(f"expected --material NAME=FILE, got '{text}'")
        pairs[name] = value
    return pairs


def _changed(scene: "Scene", times: str | None, size: str | None, paths: int | None) -> "Scene":
    """Return the scene with what was given on the command line."""
    from labrig.foundation.errors import UsageError

    width = height = None
    if size is not None:
        parts = size.lower().split("x")
        if len(parts) != 2 or not all(
            part.isascii() and part.isdigit() and 0 < int(part) <= 8192 for part in parts
        ):
            raise UsageError(f"expected --size such as 640x480, up to 8192 each, got '{size}'")
        width, height = int(parts[0]), int(parts[1])
    scene = scene.resized(width, height, paths)
    if times is None:
        return scene
    try:
        frames_s = [float(part) for part in times.split(",")]
    except ValueError:
        raise UsageError(f"expected --times in s such as 0,1,80, got '{times}'") from None
    return scene.at_times(frames_s)


def _draw(
    folder: "RenderFolder",
    scene: "Scene",
    night: bool,
    adapted_white: tuple[float, float, float] | None,
    video: Path | None,
    fps: float,
) -> None:
    """Draw all frames for a screen: a picture each, a sheet, and a film if it is wanted."""
    from labrig.foundation.number_format import rounded
    from labrig.foundation.quantity import duration_text
    from labrig.report import draw_frames
    from labrig.reproduce import shown_frames, write_png, write_video

    frames = [folder.frame(number) for number in range(folder.n_done)]
    pictures, labels = [], []
    look = scene.file.display
    notes = [str(note) for note in scene.notes]
    if adapted_white is not None and not night:
        notes.append(f"white is {look.white}, adapted to the screen by Bradford's transform")
    caption = "; ".join(notes)
    for number, (picture, display) in enumerate(
        shown_frames(frames, look.exposure, night, adapted_white)
    ):
        t_s = folder.times_s[number]
        when = f"{'−' if t_s < 0 else ''}{duration_text(abs(t_s))}" if t_s else "0 s"
        labels.append(f"{when}; white is {rounded(display.white_luminance, 2)} cd/m²")
        texts = {
            "Description": f"{scene.file.name} at {t_s:g} s",
            "Comment": "; ".join([display.statement, *map(str, scene.notes)]),
        }
        write_png(folder.path / f"{number:03d}.png", picture, texts)
        pictures.append(picture)
    draw_frames(pictures, labels, folder.path / "sheet.png", scene.file.name, caption)
    if video is not None:
        write_video(video, pictures, fps)
