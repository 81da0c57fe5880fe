"""Scenes from files: TOML scene files, and glTF with its own materials."""

from __future__ import annotations

from pathlib import Path

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mesh.files.source import map_file
from texbake.progress import ProgressSink
from texbake.rendering.scene.scene import Scene

SCENE_SUFFIXES = (".toml", ".glb", ".gltf")


def read_scene(path: PathLike, *, progress: ProgressSink | None = None) -> Scene:
    """Read a scene.

    Parameters
    ----------
    path
        A `.toml` file, whose keys `docs/reference/scenes.md` lists; or a `.glb` or `.gltf` file, as
        `texbake.rendering.scene.gltf.read_gltf_scene` says.
    progress
        Told of the stages.

    Returns
    -------
    Scene
        Images are read when a picture needs them; that their files are there is checked now.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        It is of another kind, or something in it is not as it should be: one line with the file,
        the key, what is there and what was expected.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SCENE_SUFFIXES:
        raise FileFormatError(
            f"{path}: {suffix!r} is not a suffix of scene files; "
            f"the known ones are {', '.join(SCENE_SUFFIXES)}"
        )
    data = map_file(path)
    # pydantic, which checks scene files, takes a while to load.
    if suffix == ".toml":
        from texbake.rendering.scene.file.parse import parse_scene

        return parse_scene(path, data.tobytes(), progress=progress)
    from texbake.rendering.scene.gltf import read_gltf_scene

    return read_gltf_scene(path, progress=progress)
