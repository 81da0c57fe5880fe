"""An asset folder for another program, from a mesh and its maps.

    mesh ─ turn, scale ─► .glb, .obj or USD, with the material where the program takes it
    maps ─ green, heights, channels, format ─► files by the program's names
                                             └► SETTINGS.txt: what to set where

Files appear whole, the text last; what an earlier export left under other names stays.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texbake.core import portable_math as pm
from texbake.errors import OptionError, UvError
from texbake.files import PathLike, appearing_together, make_folder, scratch_folder
from texbake.jobs.export.imports import write_imports
from texbake.jobs.export.maps import COLORS, PACKED, Converter, SourceMap, source_maps
from texbake.jobs.export.programs import (
    ExportedMap,
    ExportOptions,
    check_asset_name,
    write_settings,
)
from texbake.jobs.outputs import triangle_notes
from texbake.mesh.compose import transformed
from texbake.mesh.distance import sample_surface
from texbake.mesh.files import write_mesh
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import with_shading_normals
from texbake.mesh.transform import Y_FROM_Z
from texbake.mesh.triangle_tree import TriangleTree
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.targets import PROGRAMS
from texbake.texture.image import read_image
from texbake.texture.image_files import write_layers


@dataclass(frozen=True, kw_only=True)
class ExportResult:
    """What `export_asset` wrote."""

    mesh: Path
    textures: tuple[Path, ...]  # images that the mesh file refers to instead of containing them
    maps: tuple[ExportedMap, ...]
    settings: Path  # the text that says what to set in the program
    imports: tuple[Path, ...] = ()  # scripts and settings that import the asset; its MaterialX file
    layers: Path | None = None  # the EXR file of all maps, if `ExportOptions.layers` is set
    # what was assumed or could not be done, a sentence each
    warnings: tuple[str, ...] = ()

    @property
    def files(self) -> list[Path]:
        """Every file that was written."""
        layers = [] if self.layers is None else [self.layers]
        maps = [written.path for written in self.maps]
        return [self.mesh, *self.textures, *maps, *layers, *self.imports, self.settings]


@appearing_together()
def export_asset(
    mesh: MeshLike,
    maps: Mapping[str, PathLike],
    folder: PathLike,
    options: ExportOptions,
    *,
    levels: Sequence[Mesh] = (),
    inputs: Sequence[PathLike] = (),
    progress: Progress = None,
) -> ExportResult:
    """Write an asset as a program reads it, with a text that says what to set in the program."""
    mesh = as_mesh(mesh)
    target = PROGRAMS[options.to]
    if options.textures not in target.textures:
        raise OptionError(
            f"textures: {target.title} takes {' or '.join(target.textures)} files and compresses "
            f"them itself, not {options.textures}"
        )
    if options.compress and not target.reads_meshopt:
        readers = ", ".join(name for name, other in PROGRAMS.items() if other.reads_meshopt)
        raise OptionError(
            f"compress: {target.title} does not read compressed meshes; only {readers} does"
        )
    mesh_format = options.mesh_format or target.mesh_format
    for given, option in ((options.compress, "compress"), (levels, "levels")):
        if given and mesh_format != "glb":
            raise OptionError(f"{option}: a {mesh_format} file has none; use the mesh format glb")
    asset = options.name or Path(mesh.name).stem or "asset"
    check_asset_name(asset)
    sources = source_maps(maps)
    if sources and mesh.uvs is None:
        raise UvError(
            f"{mesh.name}: it has no texture coordinates for its maps; make some with: "
            f"texbake unwrap {mesh.name} -o OUT"
        )
    check_levels((mesh, *levels), threads=options.threads)
    read = frozenset(os.path.realpath(path) for path in (*inputs, *maps.values()))
    folder = make_folder(folder)
    converter = Converter(folder=folder, asset=asset, options=options, inputs=read)
    mesh_file = converter.place(f"{target.mesh_stem(asset)}.{mesh_format}")
    stages = Stages(progress)
    with stages.stage("write maps"):
        written = converter.write(sources)
    with stages.stage("write mesh"):
        textures = _write_mesh(mesh, mesh_file, sources, converter, levels)
    layers = None
    if options.layers and sources:
        layers = folder / f"{asset}_layers.exr"
        with stages.stage("write layers"):
            _write_layers(sources, layers, options)
    imports = write_imports(folder, replace(options, name=asset), mesh_file, written)
    settings = write_settings(
        folder, options, mesh_file, written, imports, n_levels=1 + len(levels),
        notes=converter.notes,
    )  # fmt: skip
    return ExportResult(
        mesh=mesh_file,
        imports=tuple(imports),
        textures=tuple(textures),
        maps=tuple(written),
        settings=settings,
        layers=layers,
        warnings=(*converter.notes, *triangle_notes(mesh, mesh_file)),
    )


def _write_mesh(
    mesh: Mesh,
    path: Path,
    sources: Sequence[SourceMap],
    converter: Converter,
    levels: Sequence[Mesh],
) -> list[Path]:
    """Write the mesh, Y up and in meters, with its material; return the images of that."""
    options = converter.options
    turned = [_placed(level, options) for level in (mesh, *levels)]
    if path.suffix == ".obj":
        write_mesh(with_shading_normals(turned[0]), path)
        return []
    extra: dict[str, Any] = {"name": converter.asset}
    if path.suffix == ".glb":
        extra |= {"levels": turned[1:] or None, "compress": options.compress or None}
    else:
        extra["materialx"] = options.materialx or None
    embedded = {source.kind: source for source in sources if not source.tile}
    if any(source.tile for source in sources) or not converter.target.embeds:
        embedded = {}
    images = path.parent if path.suffix in (".usda", ".usdc") else None
    with scratch_folder() as folder:
        textures = _textures(embedded, images or folder, converter)
        write_mesh(turned[0], path, **textures, **extra)
    return list(textures.values()) if images else []


def _textures(
    embedded: Mapping[str, SourceMap], folder: Path, converter: Converter
) -> dict[str, Path]:
    """Write the 8-bit images of the material, +Y; return them by the option of the mesh writer."""
    stem = f"{converter.asset}_material"
    files = {}
    if "normal" in embedded:
        files["normal_map"] = folder / f"{stem}_normal.png"
        converter.write_normals_8(embedded["normal"], files["normal_map"])
    for kind, option in zip(COLORS, ("base_color", "emissive"), strict=True):
        if kind in embedded:
            files[option] = folder / f"{stem}_{kind}.png"
            converter.write_color_8(embedded[kind], files[option])
    parts = {kind: embedded[kind] for kind in PACKED["orm"] if kind in embedded}
    if parts:
        files["orm"] = folder / f"{stem}_orm.png"
        converter.write_packed(parts, "orm", files["orm"])
    return files


def _placed(mesh: Mesh, options: ExportOptions) -> Mesh:
    """Turn a mesh Y up, and scale it to meters."""
    linear = np.eye(3) if options.up == "y" else Y_FROM_Z
    if options.up == "y" and options.meters_per_unit == 1.0:
        return mesh
    matrix = np.eye(4)
    matrix[:3, :3] = options.meters_per_unit * linear
    return transformed(mesh, matrix)


def _write_layers(sources: Sequence[SourceMap], path: Path, options: ExportOptions) -> None:
    images = {}
    for source in sources:
        name = f"{source.kind}_{source.tile}" if source.tile else source.kind
        image = read_image(source.path, color=source.kind in COLORS, threads=options.threads)
        # Half floats hold all 8-bit codes exactly, but not 16-bit codes.
        fits_half = image.bits == 8 or (image.is_float and image.bits == 16)
        images[name] = replace(source.of_channel(image), bits=16 if fits_half else 32)
    write_layers(images, path)


_SAMPLES = 2_000  # points on a level
# A level made from the finest takes nearly all its points to the same place of the texture. Another
# atlas takes next to none within a tenth of its width.
_FAR, _MOST_FAR = 0.1, 0.5


def check_levels(levels: Sequence[Mesh], *, threads: int | None = None) -> None:
    """Check that levels of detail become coarser, and that one set of maps fits all of them."""
    _check_layouts(levels, threads)
    for fine, coarse in pairwise(levels):
        if coarse.n_faces >= fine.n_faces:
            raise OptionError(
                f"levels: {coarse.name} has {coarse.n_faces:,} triangles, no fewer than "
                f"{fine.name} before it, which has {fine.n_faces:,}; give the levels from the "
                "finest to the coarsest, each once"
            )


def _check_layouts(levels: Sequence[Mesh], threads: int | None) -> None:
    mapped = next((level for level in levels if level.uvs is not None), None)
    bare = next((level for level in levels if level.uvs is None), None)
    if mapped is None:
        return
    if bare is not None:
        raise UvError(
            f"{bare.name}: it has no texture coordinates, and {mapped.name} has; levels of detail "
            "share one set: unwrap the finest, and simplify that with seams kept"
        )
    for level in levels[1:]:
        share = share_elsewhere(level, levels[0], threads=threads)
        if share > _MOST_FAR:
            raise UvError(
                f"{level.name}: its texture coordinates are laid out differently from those of "
                f"{levels[0].name}, at {100 * share:.0f} % of its surface; levels of detail share "
                "one set: unwrap the finest, and simplify that with seams kept"
            )


def share_elsewhere(level: Mesh, finest: Mesh, *, threads: int | None = None) -> float:
    """Share of a level's surface that has another place in the texture than the finest's."""
    assert level.uvs is not None and level.uv_faces is not None
    assert finest.uvs is not None and finest.uv_faces is not None
    frame = LocalFrame.around(finest)
    tree = TriangleTree.build(frame.to_local(finest.positions), finest.faces, threads=threads)
    local = level.replace(positions=frame.to_local(level.positions))
    points, face_ids, weights = sample_surface(local, _SAMPLES, threads=threads)
    _, nearest, nearest_weights = tree.closest_points(points, threads=threads)
    here = pm.vecmat(weights, level.uvs[level.uv_faces[face_ids]])
    there = pm.vecmat(nearest_weights, finest.uvs[finest.uv_faces[nearest]])
    width = np.ptp(finest.uvs[finest.uv_faces.ravel()], axis=0).max()
    return float((pm.hypot(*(here - there).T) > _FAR * width).mean())
