"""Reading scenes: TOML scene files, glTF files with their own materials, and meshes in memory."""

from __future__ import annotations

from pathlib import Path

from texbake.errors import FileFormatError, quoted, require_library
from texbake.files import PathLike, read_bytes, require_file, scratch_folder
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.progress import Progress
from texbake.rendering.scene.gltf import read_gltf_scene
from texbake.rendering.scene.scene import Scene
from texbake.texture.material_images import gltf_images

SCENE_SUFFIXES = (".toml", ".glb", ".gltf")


def read_scene(path: PathLike, *, progress: Progress = None) -> Scene:
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
        require_library("pydantic", path)
        from texbake.rendering.scene.file.schema import parse_scene

        return parse_scene(path, read_bytes(path), progress=progress)
    from texbake.rendering.scene.gltf import read_gltf_scene

    return read_gltf_scene(path, progress=progress)


def scene_from_materials(mesh: Mesh, materials: Materials | None) -> Scene:
    """Return a scene of a mesh with its materials, an object for each, and the default light."""
    if materials is not None:
        materials = gltf_images(materials if mesh.uvs is not None else materials.without_images())
    with scratch_folder() as folder:
        copy = folder / "model.glb"
        write_glb(mesh, copy, materials=materials)
        return read_gltf_scene(copy)
