"""A mesh written with the materials of the file that it comes from.

GLB files keep materials whole, OBJ files what .mtl files have of them. Other formats, as texbake
writes them, hold none.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from texbake.errors import TexbakeError, counted
from texbake.files import PathLike
from texbake.jobs.outputs import (
    BARE_MESH_SUFFIXES,
    SUFFIXES_OF_UV_SETS,
    JobResult,
    Report,
    present_paths,
    triangle_notes,
    uv_set_files,
)
from texbake.mesh.decimate import shading_length
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.mtl import write_obj_materials
from texbake.mesh.files.source import parsed_once
from texbake.mesh.files.unread_parts import unread_parts
from texbake.mesh.materials import ChannelSource, Materials, MeshMaterial, read_materials
from texbake.mesh.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from texbake.mesh.part_sizes import EnlargedParts
from texbake.mesh.rig import Rig, read_rig
from texbake.mesh.simplify import SimplifyReport, simplify_with_report
from texbake.progress import Progress
from texbake.records import dataclass
from texbake.texture.model_materials import without_damaged_images

_GLTF = (".glb", ".gltf")
_TITLES = {"uvs": "texture coordinates", "normals": "normals", "colors": "vertex colors"}


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFileMaterials:
    """The materials of a mesh file, for meshes that are made from it."""

    path: Path  # the file
    # Those of the faces; None where the file has none, or what it has is damaged.
    materials: Materials | None
    lost: tuple[str, ...] = ()  # what of them could not be read or kept
    passed_over: tuple[str, ...] = ()  # what else is in the file that a mesh has no place for
    rig: Rig | None = None  # nodes, skins, animations and so on, where its format has them

    @classmethod
    def read(cls, path: PathLike, mesh: Mesh) -> MeshFileMaterials:
        """Read the materials of the file that a mesh was read from."""
        lost: tuple[str, ...] = ()
        with parsed_once():
            try:
                materials = read_materials(path, mesh)
            except TexbakeError:  # it is damaged
                materials, lost = None, ("materials",)
            further, rig = unread_parts(path), read_rig(path)
        if materials is not None and not any(item.channels for item in materials.materials):
            lost = ("materials",) if materials.missing else ()
            materials = None
        return cls(path=Path(path), materials=materials, lost=lost, passed_over=further, rig=rig)

    def fit(self, output: PathLike, *, mtl: bool) -> bool:
        """Whether there are materials, and a file of the format of `output` holds them."""
        suffixes = (".glb", ".obj") if mtl else (".glb",)
        return self.materials is not None and Path(output).suffix.lower() in suffixes

    def of_faces(self, chosen: BoolArray | IndexArray) -> MeshFileMaterials:
        """Return the materials of some faces of the mesh, on its first texture coordinates."""
        if self.materials is None:
            return self
        return self.shown_on(self.materials.face_materials[chosen], has_further=False)

    def shown_on(self, face_materials: IntArray, *, has_further: bool) -> MeshFileMaterials:
        """Return the materials on other faces, which may lack the further texture coordinates."""
        assert self.materials is not None
        lost, kept = self.lost, replace(self.materials, face_materials=face_materials)
        if not has_further:
            if kept.image_uv_sets - {0}:
                lost = (*lost, "images on further texture coordinates")
            items = tuple(item.on_uv_sets((0,)) for item in kept.materials)
            kept = replace(kept, materials=items, uv_sets={})
        return replace(self, materials=kept, lost=lost)

    def without_hidden(
        self, mesh: Mesh, *, threads: int | None
    ) -> tuple[Mesh, MeshFileMaterials, tuple[str, ...]]:
        """Return the mesh and its materials without parts that nobody sees, and a note."""
        from texbake.baking.parts.high_parts import materials_of_faces
        from texbake.mesh.compose import excerpt
        from texbake.raycast.hidden_faces import hidden_faces

        if self._moves(mesh):
            return mesh, self, (f"{mesh.name}: all parts stay, because the mesh can move",)
        hidden = hidden_faces(mesh, *self.walls(mesh.n_faces), threads=threads)
        if not hidden.any():
            return mesh, self, (f"{mesh.name}: no part is hidden",)
        note = f"{mesh.name}: dropped {counted(int(hidden.sum()), 'triangle')} of hidden parts"
        materials = self.materials
        if materials is not None:
            materials = materials_of_faces(materials, mesh, ~hidden)
        return excerpt(mesh, ~hidden), replace(self, materials=materials), (note,)

    def visible_shares(self, mesh: Mesh, *, threads: int | None) -> FloatArray | None:
        """(V,) how much vertices count by how well they are seen, or None if all count alike."""
        from texbake.raycast.hidden_faces import visible_shares

        if self._moves(mesh):
            return None
        return visible_shares(mesh, *self.walls(mesh.n_faces), threads=threads)

    def _moves(self, mesh: Mesh) -> bool:
        has_animations = self.rig is not None and self.rig.content.get("animations")
        return bool(mesh.deformation is not None or has_animations)

    def walls(self, n_faces: int) -> tuple[BoolArray, BoolArray]:
        """(F,) bool: faces through which nothing is seen, and those not drawn from behind."""
        if self.materials is None:
            return np.ones(n_faces, dtype=np.bool_), np.zeros(n_faces, dtype=np.bool_)
        kinds = [(item.is_opaque, not item.is_double_sided) for item in self.materials.materials]
        own = np.array(kinds)
        sides = own.copy()
        for _, table in self.materials.variants:
            sides &= own[list(table)]
        is_opaque, is_one_sided = sides[self.materials.face_materials].T
        return is_opaque, is_one_sided

    def rig_of(self, mesh: Mesh, output: PathLike) -> Rig | None:
        """Return the rig for a mesh made from that of the file, if its objects and format fit."""
        is_glb = Path(output).suffix.lower() == ".glb"
        return self.rig if is_glb and self.rig is not None and self.rig.fits(mesh) else None

    def without_images(self) -> MeshFileMaterials:
        """Return the materials with their factors alone, for other texture coordinates."""
        if self.materials is None:
            return self
        return replace(self, materials=self.materials.without_images())


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialPartition:
    """A mesh whose groups distinguish its materials as well, and what they stand for."""

    mesh: Mesh
    source: MeshFileMaterials
    # (G, 2) int32; group and material of each group of `mesh`; None where there is one material at
    # most.
    parts: IntArray | None

    @classmethod
    def of(cls, mesh: Mesh, source: MeshFileMaterials) -> MaterialPartition:
        """Divide the groups of a mesh by its materials."""
        materials = source.materials
        if materials is None or len(np.unique(materials.face_materials)) < 2:
            return cls(mesh=mesh, source=source, parts=None)
        groups = mesh.face_groups
        if groups is None:
            groups = np.zeros(mesh.n_faces, dtype=np.int32)
        pairs = np.stack([groups, materials.face_materials], axis=1)
        parts, part_of = np.unique(pairs, axis=0, return_inverse=True)
        objects = np.array(mesh.group_objects or (0,) * len(mesh.group_names) or (0,))
        divided = mesh.replace(
            face_groups=part_of.ravel().astype(np.int32),
            group_names=tuple(map(str, range(len(parts)))),
            group_objects=tuple(objects[parts[:, 0]].tolist()),
        )
        return cls(mesh=divided, source=source, parts=parts.astype(np.int32))

    def restored(self, made: Mesh, mesh: Mesh) -> tuple[Mesh, MeshFileMaterials]:
        """What was made, with groups of `mesh` and materials; further uvs stay if its uvs do."""
        materials = self.source.materials
        if materials is None:
            return made, self.source
        if self.parts is None or made.face_groups is None:
            of_faces = np.repeat(materials.face_materials[:1], made.n_faces)
        else:
            parts = self.parts[made.face_groups]
            of_faces = parts[:, 1]
            groups = None if mesh.face_groups is None else parts[:, 0]
            made = made.replace(
                face_groups=groups, group_names=mesh.group_names, group_objects=mesh.group_objects
            )
        uvs, made_uvs = mesh.uvs, made.uvs
        has_further = uvs is not None and made_uvs is not None and np.array_equal(uvs, made_uvs)
        return made, self.source.shown_on(of_faces, has_further=has_further)


@dataclass(frozen=True, eq=False)
class MaterialSimplifier:
    """Simplifies a mesh that keeps its seams, shading, materials, and small parts their faces."""

    mesh: Mesh
    materials: Materials
    quality: str
    threads: int | None
    progress: Progress

    @cached_property
    def _partition(self) -> MaterialPartition:
        source = MeshFileMaterials(path=Path(self.mesh.name), materials=self.materials)
        return MaterialPartition.of(self.mesh, source)

    @cached_property
    def _parts(self) -> EnlargedParts:
        return EnlargedParts.of(self._partition.mesh, threads=self.threads)

    def made(self, n_faces: int) -> tuple[Mesh, SimplifyReport, Materials]:
        """Return the mesh with fewer faces, and their materials."""
        low, report = simplify_with_report(
            self._parts.mesh, n_faces, quality=self.quality, seams="keep",
            shades=shading_length(self.mesh), parts=self._parts, threads=self.threads,
            progress=self.progress,
        )  # fmt: skip
        low, kept = self._partition.restored(low, self.mesh)
        return low, report, kept.materials or self.materials


def bare_materials(path: PathLike, mesh: Mesh) -> Materials:
    """Return what is shown where a file has no materials: for glTF, its default material."""
    is_gltf = Path(path).suffix.lower() in _GLTF
    values = {"metallic": 1.0, "roughness": 1.0} if is_gltf else {"roughness": 0.5}
    channels = {name: ChannelSource((value,)) for name, value in values.items()}
    bare = MeshMaterial(name=mesh.name, channels=channels)
    return Materials(face_materials=np.zeros(mesh.n_faces, np.int32), materials=(bare,))


def read_with_materials(path: PathLike, progress: Progress) -> tuple[Mesh, MeshFileMaterials]:
    """Read a mesh file with its materials, parsing it once."""
    with parsed_once():
        mesh = read_mesh(path, progress=progress)
        return mesh, MeshFileMaterials.read(path, mesh)


def write_result(
    mesh: Mesh, output: PathLike, source: MeshFileMaterials, report: Report, *, mtl: bool
) -> JobResult[Report]:
    """Write a mesh with materials; warnings name what the output cannot hold."""
    files, warnings = write_with_materials(mesh, output, source, mtl=mtl)
    return JobResult(files=files, report=report, warnings=warnings)


def write_with_materials(
    mesh: Mesh, output: PathLike, source: MeshFileMaterials, *, mtl: bool
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Write a mesh with materials, OBJ by `mtl`; return files and warnings of what is lost."""
    lost = list(source.lost)
    if Path(output).suffix.lower() in BARE_MESH_SUFFIXES:
        lost += [title for name, title in _TITLES.items() if getattr(mesh, name) is not None]
    is_gltf = source.path.suffix.lower() in _GLTF and Path(output).suffix.lower() in _GLTF
    if source.materials is None and is_gltf and not lost:
        source = replace(source, materials=bare_materials(source.path, mesh))
    materials = source.materials
    files = present_paths(output)
    notes: list[str] = []
    rig = source.rig_of(mesh, output)
    if materials is None:
        write_mesh(mesh, output, rig=rig)
    elif not source.fit(output, mtl=mtl) or mesh.n_faces != len(materials.face_materials):
        lost.append("materials")
        write_mesh(mesh, output, rig=rig)
    else:
        materials, damaged = without_damaged_images(_of_uvs(mesh, materials, lost))
        notes += damaged
        if Path(output).suffix.lower() == ".glb":
            from texbake.texture.material_images import gltf_images

            materials = gltf_images(_of_colors(mesh, materials, lost))
            notes += materials.notes()
            write_mesh(mesh, output, materials=materials, rig=rig)
        else:
            from texbake.texture.material_images import mtl_images

            lost += ["material variants"] * bool(materials.variants)
            materials, without = mtl_images(materials.in_variant(None))
            lost += without
            files = write_obj_materials(mesh, output, materials)
    if mesh.uv_sets and Path(output).suffix.lower() not in SUFFIXES_OF_UV_SETS:
        lost.append("further texture coordinates")
    files = (*files, *uv_set_files(mesh, output))
    lost += source.passed_over if rig is None else rig.passed_over
    if rig is not None and mesh.deformation is None and rig.has_morphs:
        lost.append("morph targets")  # `write_mesh` warns of skins
    notes += triangle_notes(mesh, output)
    if lost:
        notes.append(f"{output}: written without {', '.join(lost)}")
    return files, tuple(notes)


def _of_uvs(mesh: Mesh, materials: Materials, lost: list[str]) -> Materials:
    """Materials without images, if a mesh has no texture coordinates."""
    if mesh.uvs is not None or not materials.has_images:
        return materials
    lost.append("images, for which there are no texture coordinates")
    return materials.without_images()


def _of_colors(mesh: Mesh, materials: Materials, lost: list[str]) -> Materials:
    """Materials that are multiplied by vertex colors, if they have no colors of their own."""
    if mesh.colors is None or materials.has_vertex_colors:
        return materials
    if not any(materials.sources("base-color")):
        return replace(materials, has_vertex_colors=True)
    lost.append("vertex colors")
    return materials
