"""The folder of a rendering: finished frames, and what it takes to go on after an interruption."""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from labrig.foundation.array_file import read_arrays, write_arrays
from labrig.foundation.arrays import Float32Array
from labrig.foundation.errors import UsageError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.foundation.output_file import make_folder, write_text
from labrig.reproduce.picture.exr import SpectralFrame, read_spectral_exr, write_spectral_exr
from labrig.reproduce.picture.rendering import Frame, Renderer
from labrig.reproduce.picture.view import Report
from labrig.reproduce.scene.built_scene import Scene

CONTENT = "render.json"
#: What the names of materials follow in the file of levels.
OF = "levels of "


@dataclass(frozen=True)
class RenderFolder:
    """A folder with the frames of one rendering.

    It holds `render.json` with the scene and what was assumed, and of each frame a spectral EXR and
    the levels of all phosphors at its time.

    Attributes
    ----------
    path
        Path of the folder.
    times_s
        Times of all frames of the scene in s.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.reproduce import RenderFolder, load_scene
    >>> scene = load_scene("cornell-box").resized(width_px=8, height_px=8, paths=2)
    >>> folder = RenderFolder.open(Path("box"), scene)
    >>> [frame.t_s for frame in folder.rendered(scene)]
    [-1.0, 0.1, 60.0]
    >>> folder.n_done, folder.frame(2).radiance.shape
    (3, (8, 8, 24))
    """

    path: Path
    times_s: tuple[float, ...]

    @classmethod
    def open(cls, path: Path, scene: Scene) -> "RenderFolder":
        """Make a folder, or open one in which the same rendering was interrupted.

        Parameters
        ----------
        path
            Path of the folder.
        scene
            The scene.

        Raises
        ------
        UsageError
            The folder holds something else.
        DiskError
            It cannot be written.
        """
        content = path / CONTENT
        identity = _identity(scene)
        if content.is_file():
            try:
                known = json.loads(read_text(content, MAX_JSON_BYTES))["identity"]
            except (ValueError, KeyError, TypeError, RecursionError):
                known = None
            # One that failed before its first frame leaves nothing that is worth keeping.
            is_begun = known is None or any(path.glob("*.exr"))
            if known != identity and is_begun:
                raise UsageError(
                    f"{path}: expected a new folder or the same rendering, got another scene, "
                    "other materials or other settings; give another folder (--out)"
                )
            if known == identity:
                return cls(path, scene.file.frames_s)
        elif path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise UsageError(
                f"{path}: expected a new folder, got one without {CONTENT}; give another (--out)"
            )
        make_folder(path)
        described = {
            "identity": identity,
            "notes": [note.to_dict() for note in scene.notes],
            "scene": scene.file.model_dump(mode="json", exclude_defaults=True),
        }
        write_text(content, json.dumps(described, indent=1, ensure_ascii=False))
        return cls(path, scene.file.frames_s)

    @property
    def n_done(self) -> int:
        """Number of finished frames."""
        done = 0
        while done < len(self.times_s) and self.exr(done).is_file():
            done += 1
        return done

    def exr(self, number: int) -> Path:
        """Return the path of a frame's spectral EXR."""
        return self.path / f"{number:03d}.exr"

    def frame(self, number: int) -> SpectralFrame:
        """Return a finished frame.

        Raises
        ------
        UsageError, DataError
            It is not there, or its file is damaged.
        """
        return read_spectral_exr(self.exr(number))

    def rendered(
        self, scene: Scene, threads: int | None = None, report: Report = lambda what, part: None
    ) -> Iterator[Frame]:
        """Render the frames that are missing, and keep each.

        Parameters
        ----------
        scene
            The scene with which the folder was opened.
        threads
            Threads that trace and fold. Default: one for each processor.
        report
            Is told what is done, as by `Renderer`.

        Yields
        ------
        Frame
            Each new frame, after it was written.

        Raises
        ------
        UsageError, DataError
            The scene cannot be rendered, or what was kept is damaged.
        DiskError
            The folder cannot be written.
        """
        done = self.n_done
        if done == len(self.times_s):
            return
        renderer = Renderer(scene, threads, report)
        if done:
            renderer.restore(self.times_s[done - 1], self.levels(done - 1))
        for number in range(done, len(self.times_s)):
            frame = renderer.frame(self.times_s[number])
            self._keep_levels(number, renderer.levels)
            # The frame comes last: it says that all of it is there.
            texts = {"t_s": repr(frame.t_s), "scene": scene.file.name}
            write_spectral_exr(self.exr(number), frame.radiance, scene.bands.edges_nm, texts)
            yield frame

    def levels(self, number: int) -> dict[str, Float32Array]:
        """Return the levels of each phosphor at a finished frame, shape (states, places).

        Raises
        ------
        UsageError
            They are not there.
        """
        try:
            arrays = read_arrays(self._levels_path(number))
        except UsageError as error:
            raise UsageError(
                f"{error}; these should be the levels of a finished frame: remove {self.path} to "
                "begin anew"
            ) from None
        return {name.removeprefix(OF): levels for name, levels in arrays.items()}

    def _keep_levels(self, number: int, levels: dict[str, Float32Array]) -> None:
        named = {f"{OF}{name}": level for name, level in levels.items()}
        write_arrays(self._levels_path(number), named)

    def _levels_path(self, number: int) -> Path:
        return self.path / f"{number:03d}.levels.npz"


def _identity(scene: Scene) -> str:
    """Return a hash of all that the numbers depend on."""
    # How pictures are shown may change.
    digest = hashlib.sha256(scene.file.model_dump_json(exclude={"display"}).encode())
    for material in scene.materials:
        digest.update(material.matrix.tobytes())
        if (parameters := material.parameters) is not None:
            for array in (
                parameters.k_r_per_s,
                parameters.k_e_per_s,
                parameters.reradiation,
                parameters.order,
                np.array(parameters.prompt),
            ):
                digest.update(array.tobytes())
        if (texture := material.texture) is not None:
            digest.update(repr(texture.shape).encode())
            if texture.albedo_factor is not None:
                digest.update(texture.albedo_factor.tobytes())
    for t_s in (scene.file.programme[0].at_s, *scene.file.frames_s):
        for surface in scene.surfaces(t_s):
            mesh = surface.mesh
            where = (surface.samples, surface.material, surface.lamp, surface.is_two_sided)
            digest.update(repr((surface.name, len(mesh.vertices_m), where)).encode())
            for each in (mesh.vertices_m, mesh.faces, mesh.uv, surface.material_of_texel):
                digest.update(b"" if each is None else each.tobytes())
        for lamp in scene.lamps(t_s):
            digest.update(lamp.light.tobytes())
    return digest.hexdigest()
