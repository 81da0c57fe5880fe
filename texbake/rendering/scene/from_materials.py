"""A mesh in memory with materials as a scene: written as a GLB file, and read like any other."""

from __future__ import annotations

from texbake.files import scratch_folder
from texbake.mesh.files.gltf_write import write_glb
from texbake.mesh.materials import Materials
from texbake.mesh.mesh import Mesh
from texbake.rendering.scene.gltf import read_gltf_scene
from texbake.rendering.scene.scene import Scene
from texbake.texture.gltf_images import gltf_images


def scene_from_materials(mesh: Mesh, materials: Materials | None) -> Scene:
    """Return a scene of a mesh with its materials, an object for each, and the default light."""
    if materials is not None:
        materials = gltf_images(materials if mesh.uvs is not None else materials.without_images())
    with scratch_folder() as folder:
        copy = folder / "model.glb"
        write_glb(mesh, copy, materials=materials)
        return read_gltf_scene(copy)
