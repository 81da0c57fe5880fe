"""Reading scenes from files: TOML scene files, and glTF files with their own materials."""

from __future__ import annotations

from pathlib import Path

from texbake.errors import FileFormatError, quoted
from texbake.files import PathLike, read_bytes, require_file
from texbake.progress import ProgressSink
from texbake.rendering.scene.scene import Scene

SCENE_SUFFIXES = (".toml", ".glb", ".gltf")


def read_scene(path: PathLike, *, progress: ProgressSink | None = None) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path
        A `.toml` file with the keys listed in `docs/reference/scenes.md`, or a `.glb` or `.gltf`
        file (see `texbake.rendering.scene.gltf.read_gltf_scene`).
    progress
        Receives the stages.

    Returns
    -------
    Scene
        Images are read when a picture needs them; only their existence is checked now.

    Raises
    ------
    FileError
        The file is missing or cannot be read.
    FileFormatError
        The format is not supported, or the content is not valid. The message is a single line with
        the file, the key, the value and what was expected.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SCENE_SUFFIXES:
        raise FileFormatError(
            f"{path}: {quoted(suffix)} is not a suffix of scene files; "
            f"the known ones are {', '.join(SCENE_SUFFIXES)}"
        )
    require_file(path)
    # pydantic, which validates scene files, is slow to import.
    if suffix == ".toml":
        from texbake.rendering.scene.file.parse import parse_scene

        return parse_scene(path, read_bytes(path), progress=progress)
    from texbake.rendering.scene.gltf import read_gltf_scene

    return read_gltf_scene(path, progress=progress)
