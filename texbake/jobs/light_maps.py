"""Light maps: the static lighting of a scene, computed once for every texel of its objects.

A texel holds what a white, matte surface reflects at that place: ambient light, and the light of
each static lamp times the cosine of its angle of incidence, with shadows cast by rays
(`texbake.jobs.static_light`). A renderer multiplies the map by the color of the surface.

A map leaves out what depends on the point of view or on finer geometry: highlights, normal and bump
maps, and displacement. It holds the lighting of the front of a surface.

Based on: Abrash, "Quake's lighting model: surface caching", Dr. Dobb's Sourcebook, 1996.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from texbake.baking.options import BakeOptions
from texbake.baking.texel_values import ChartPadding
from texbake.baking.texels import NO_FACE, SampleGrid, Samples, owned_bands, snap_uvs
from texbake.errors import OptionError, UvError, counted
from texbake.files import PathLike
from texbake.jobs.static_light import LitSurface, StaticLight, is_static
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import FIRST_UV_SET, BoolArray, Float32Array, Mesh
from texbake.parallel import run_bands
from texbake.progress import Progress, StageRecord, Stages
from texbake.records import dataclass
from texbake.rendering.scene.lights import Ambient
from texbake.rendering.scene.scene import Scene, apply_mapping, place_mesh
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.image import write_image

# Samples a band: as many as the caster takes at once.
_BAND = 1 << 14


@dataclass(frozen=True, kw_only=True, eq=False)
class LightMap:
    """The lighting of one object."""

    index: int  # of the object in the scene
    name: str  # of the object
    # (H, W, 3) float32; linear, not limited to 1, row 0 at the top; 0 outside the charts and their
    # padding.
    values: Float32Array
    has_data: BoolArray  # (H, W) bool; texels that a face covers
    n_overlapping: int  # samples that several faces cover; each has the lighting of one of them
    n_outside: int  # faces that extend beyond the unit square; what lies outside is not baked
    # Further set of texture coordinates that it lies on; None for the first.
    uv_set: str | None = None

    def write(self, path: PathLike, *, bits: int | None = None, threads: int | None = None) -> None:
        """Write an image file: linear values in files of floats, else sRGB limited to 1."""
        write_image(self.values, path, bits=bits, color=True, threads=threads)


@dataclass(frozen=True, kw_only=True, eq=False)
class LightMaps:
    """The light maps of a scene."""

    maps: tuple[LightMap, ...]  # in the order of the objects
    warnings: tuple[str, ...]  # what is missing from them, or may look unexpected
    stages: list[StageRecord]

    def table(self) -> list[tuple[str, str]]:
        """Return rows of a label and a figure, one for each map."""
        rows = []
        for item in self.maps:
            covered = item.values[item.has_data]
            brightest = float(covered.max()) if len(covered) else 0.0
            rows.append((item.name, f"{counted(len(covered), 'texel')}, brightest {brightest:.3g}"))
        return rows

    def shown_in(self, scene: Scene) -> Scene:
        """Return the scene with its maps in place of the lights that they hold."""
        by_index = {item.index: item for item in self.maps}
        objects = []
        for index, item in enumerate(scene.objects):
            if index in by_index:
                found = by_index[index]
                texture = ImageTexture(image=found.values, filter="bilinear", uv_set=found.uv_set)
                item = replace(item, material=replace(item.material, light_map=texture))
            elif item.material.shading != "unlit":
                raise OptionError(
                    f"{scene.name}: {item.name} has no light map, and the lights of the maps would "
                    "be missing on it; give it texture coordinates with: texbake unwrap"
                )
            objects.append(item)
        lights = tuple(light for light in scene.lighting.lights if not is_static(light))
        lighting = replace(scene.lighting, lights=lights, ambient=Ambient())
        return replace(scene, objects=tuple(objects), lighting=lighting)


def light_map_images(scene: Scene) -> set[Path]:
    """Return the files of a scene's light maps, which a new bake may replace."""
    slots = [item.material.light_map for item in scene.objects]
    images = [getattr(slot, "image", None) for slot in slots]
    return {Path(image) for image in images if isinstance(image, str | os.PathLike)}


def file_names(names: Sequence[str]) -> list[str]:
    """Return distinct file names for objects, whose names may repeat and have any character.

    >>> file_names(["lamp", "lamp", "a/b"])
    ['lamp', 'lamp_2', 'a_b']
    """
    names_in_use: set[str] = set()
    distinct = []
    for name in names:
        plain = re.sub(r"[^\w.-]+", "_", name).strip(".") or "object"
        candidate, count = plain, 1
        while candidate.lower() in names_in_use:
            count += 1
            candidate = f"{plain}_{count}"
        names_in_use.add(candidate.lower())
        distinct.append(candidate)
    return distinct


def bake_light_maps(
    scene: Scene,
    options: BakeOptions | None = None,
    *,
    uv_set: str | None = None,
    progress: Progress = None,
) -> LightMaps:
    """Bake the static lighting of a scene into a map for each object with texture coordinates.

    Parameters
    ----------
    scene
        As `texbake.rendering.scene.read.read_scene` reads it, or made in Python.
    options
        Only `size`, `samples`, `padding`, `fill` and `threads` are used. None for the defaults.
    uv_set
        Further set of texture coordinates that the maps lie on, for the objects that have it. The
        others are baked on their first set, as all are if it is None.
    progress
        True shows a bar for the running stage; a listener is called with each stage.

    Returns
    -------
    LightMaps
        The same, byte for byte, for any number of threads.

    Raises
    ------
    UvError
        No lit object has texture coordinates, or they cover no texel; or none has the set.
    TexbakeError
        The image of a projector lamp cannot be read.

    Examples
    --------
    >>> from texbake.mesh.shapes import plane
    >>> from texbake.rendering.scene.lights import Light, Lighting
    >>> from texbake.rendering.scene.scene import SceneObject
    >>> lighting = Lighting(lights=(Light(direction=(0, 0, -1)),))
    >>> scene = Scene(objects=(SceneObject(mesh=plane()),), lighting=lighting)
    >>> bake_light_maps(scene, BakeOptions(size=16)).maps[0].values[8, 8].tolist()
    [1.0, 1.0, 1.0]
    """
    options = options or BakeOptions()
    stages = Stages(progress)
    meshes = [place_mesh(apply_mapping(item, threads=options.threads)) for item in scene.objects]
    chosen = [
        index
        for index, item in enumerate(scene.objects)
        if item.material.shading != "unlit" and meshes[index].uvs is not None
    ]
    if not chosen:
        raise UvError(
            f"{scene.name}: none of its lit objects has the texture coordinates that light maps "
            "need; make some with: texbake unwrap MESH -o OUT"
        )
    have_set = any(uv_set in meshes[index].uv_sets for index in chosen)
    if not have_set and uv_set not in (None, FIRST_UV_SET):
        raise UvError(
            f"{scene.name}: none of its lit objects has the texture coordinates {uv_set}; make "
            f"some with: texbake unwrap MESH --uv-set {uv_set} -o OUT"
        )
    with stages.stage("build ray tree"):
        lamps = StaticLight(scene, meshes, options.threads)
    maps = tuple(_baked(scene, meshes[i], i, lamps, options, uv_set, stages) for i in chosen)
    return LightMaps(maps=maps, warnings=tuple(_warnings(scene, maps)), stages=stages.records)


def _warnings(scene: Scene, maps: tuple[LightMap, ...]) -> Iterator[str]:
    if not any(item.values.any() for item in maps):
        yield (
            f"{scene.name}: its light maps are black; add ambient light, or a static light that "
            "shines on an object"
        )
    has_map = {item.index for item in maps}
    for index, item in enumerate(scene.objects):
        if item.material.shading != "unlit" and index not in has_map:
            yield f"{item.name}: it has no texture coordinates and gets no light map"
        elif index in has_map and item.material.displacement is not None:
            yield f"{item.name}: its light map is that of the surface without displacement"
    for light in scene.lighting.lights:
        if light.static and light.follows_camera:
            yield f"light {light.name}: it follows the camera and is left out of the light maps"
    for map_ in maps:
        if map_.n_overlapping:
            n = counted(
                map_.n_overlapping, "sample of its light map lies", "samples of its light map lie"
            )
            yield (
                f"{map_.name}: {n} on more than one face; give each face coordinates of its own "
                "with: texbake unwrap"
            )
        if map_.n_outside:
            n = counted(map_.n_outside, "triangle extends", "triangles extend")
            yield f"{map_.name}: {n} beyond the unit square"


def _baked(
    scene: Scene,
    mesh: Mesh,
    index: int,
    lamps: StaticLight,
    options: BakeOptions,
    uv_set: str | None,
    stages: Stages,
) -> LightMap:
    item = scene.objects[index]
    uv_set = uv_set if uv_set in mesh.uv_sets else None
    mesh = mesh.on_uv_set(uv_set)
    grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
    faces = snap_uvs(mesh, grid)
    surface = LitSurface.of(mesh, options.threads)
    values = np.zeros((grid.height, grid.width, 3), np.float32)
    texel_faces = np.full((grid.height, grid.width), NO_FACE, np.int32)
    n_overlapping = 0
    for band in owned_bands(faces, grid, stages, name=f"bake {item.name}", threads=options.threads):
        with stages.part("light texels"):
            light = _light_of(surface, band.samples, lamps, item.receives_shadows, options.threads)
            counts = np.maximum(band.counts(), 1)
            rows = slice(band.rows.start, band.rows.stop)
            values[rows] = (band.sums(light) / counts[:, None]).reshape(values[rows].shape)
            band.note_faces(texel_faces)
            n_overlapping += band.n_overlaps
    has_data = texel_faces != NO_FACE
    with stages.part("pad"):
        charts = np.append(chart_ids(mesh), NO_FACE).astype(np.int32)[texel_faces]
        values = ChartPadding(charts, has_data, options).pad(values, (0.0, 0.0, 0.0))
    return LightMap(
        index=index,
        name=item.name,
        values=values,
        has_data=has_data,
        n_overlapping=n_overlapping,
        n_outside=faces.n_outside_tile,
        uv_set=uv_set,
    )


def _light_of(
    surface: LitSurface, samples: Samples, lamps: StaticLight, receives: bool, threads: int | None
) -> Float32Array:
    """(n, 3) float32: lighting at samples, computed in bands."""
    light = np.empty((len(samples), 3), np.float32)

    def work(start: int, stop: int) -> None:
        part = Samples(*(array[start:stop] for array in samples.arrays()))
        points, normals, sides = surface.at(part)
        light[start:stop] = lamps.light_at(points, normals, sides, receives=receives)

    run_bands(work, len(samples), band=_BAND, threads=threads)
    return light
