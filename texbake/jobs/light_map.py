"""Light maps: the static light of a scene, gathered once for every texel of its objects.

A texel holds what a white, dull surface there would send out: ambient light, and of every static
lamp its light times the cosine at which it falls, with shadows by rays
(`texbake.jobs.static_light`). A picture multiplies the map by the color of the surface.

What a map cannot hold is left out: highlights, which look different from every side, normal and
bump maps, and displacement. It is that of the front of a surface.

Based on: Abrash, "Quake's lighting model: surface caching", Dr. Dobb's Sourcebook, 1996.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from texbake.baking.options import BakeOptions
from texbake.baking.surround import Surroundings
from texbake.baking.texels import (
    NO_FACE,
    SampleGrid,
    Samples,
    SnappedFaces,
    owned_samples,
    rasterize_uv,
    snap_uvs,
)
from texbake.baking.trace import rows_at_once
from texbake.errors import OptionError, UvError
from texbake.files import PathLike
from texbake.jobs.static_light import StaticLight, SurfacePoints, is_static
from texbake.mapping.seams import chart_ids
from texbake.mesh.mesh import IntArray, Mesh
from texbake.parallel import run_bands
from texbake.progress import ProgressSink, StageRecord, Stages
from texbake.rendering.fragments import Floats
from texbake.rendering.scene.lights import Ambient
from texbake.rendering.scene.placing import placed
from texbake.rendering.scene.scene import Scene
from texbake.rendering.scene.textures import ImageTexture
from texbake.texture.image import write_image

# Samples a band: as many as the caster takes at once.
_BAND = 1 << 14


@dataclass(frozen=True, kw_only=True, eq=False)
class LightMap:
    """Light that arrives at one object.

    Attributes
    ----------
    index, name : int, str
        Of the object in the scene.
    values : (H, W, 3) float32
        Linear, not limited to 1; row 0 at the top. 0 where there is no surface, but for padding.
    has_data : (H, W) bool
        Texels with surface.
    n_overlapping : int
        Samples that more than one face covers: they have the light of one of them alone.
    n_outside : int
        Faces with coordinates outside the unit square; what lies outside is not baked.
    """

    index: int
    name: str
    values: Floats
    has_data: npt.NDArray[np.bool_]
    n_overlapping: int
    n_outside: int

    def write(self, path: PathLike, *, bits: int | None = None, threads: int | None = None) -> None:
        """Write an image file: as it is in EXR, TIFF and HDR of floats, else sRGB up to 1.

        Raises as `texbake.texture.image.write_image` does.
        """
        write_image(self.values, path, bits=bits, color=True, threads=threads)


@dataclass(frozen=True, kw_only=True, eq=False)
class LightMaps:
    """The light maps of a scene.

    Attributes
    ----------
    maps : tuple of LightMap
        In the order of the objects.
    warnings : tuple of str
        What is not in them, or may not look as expected.
    stages : list of StageRecord
    """

    maps: tuple[LightMap, ...]
    warnings: tuple[str, ...]
    stages: list[StageRecord]

    def shown_in(self, scene: Scene) -> Scene:
        """Return the scene with its maps in place of the light that they hold.

        Raises
        ------
        OptionError
            An object that light falls on has no map, and would be dark.
        """
        by_index = {item.index: item.values for item in self.maps}
        objects = []
        for index, item in enumerate(scene.objects):
            if index in by_index:
                texture = ImageTexture(image=by_index[index], filter="bilinear")
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


def bake_light_maps(
    scene: Scene, options: BakeOptions | None = None, *, progress: ProgressSink | None = None
) -> LightMaps:
    """Bake the static light of a scene into a map for each object with texture coordinates.

    Parameters
    ----------
    scene
        As `texbake.rendering.scene.read.read_scene` reads it, or made in Python.
    options
        `size`, `samples`, `padding`, `fill` and `threads` count; None for the defaults.
    progress
        Told of the stages.

    Returns
    -------
    LightMaps
        The same, byte for byte, for any number of threads.

    Raises
    ------
    UvError
        No object that light falls on has texture coordinates, or they cover nothing.
    TexbakeError
        A slide cannot be read.

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
    meshes = [placed(item) for item in scene.objects]
    chosen = [
        index
        for index, item in enumerate(scene.objects)
        if item.material.shading != "unlit" and meshes[index].uvs is not None
    ]
    if not chosen:
        raise UvError(
            f"{scene.name}: no object that light falls on has texture coordinates, which light "
            "maps need; make some with: texbake unwrap MESH -o OUT"
        )
    with stages.stage("build ray tree"):
        lamps = StaticLight(scene, meshes, options.threads)
    try:
        maps = tuple(_baked(scene, meshes[i], i, lamps, options, stages) for i in chosen)
    finally:
        lamps.close()
    return LightMaps(maps=maps, warnings=tuple(_warnings(scene, maps)), stages=stages.records)


def _warnings(scene: Scene, maps: tuple[LightMap, ...]) -> Iterator[str]:
    has_map = {item.index for item in maps}
    for index, item in enumerate(scene.objects):
        if item.material.shading != "unlit" and index not in has_map:
            yield f"{item.name}: it has no texture coordinates, and so gets no light map"
        elif index in has_map and item.material.displacement is not None:
            yield f"{item.name}: its light is that of the surface before displacement"
    for light in scene.lighting.lights:
        if light.static and light.follows_camera:
            yield f"light {light.name}: it follows the camera, and so is in no light map"
    for map_ in maps:
        if map_.n_overlapping:
            yield (
                f"{map_.name}: {map_.n_overlapping:,} samples of its light map lie on more than "
                "one face; give each face coordinates of its own with: texbake unwrap"
            )
        if map_.n_outside:
            yield f"{map_.name}: {map_.n_outside:,} faces reach out of the unit square"


def _baked(
    scene: Scene, mesh: Mesh, index: int, lamps: StaticLight, options: BakeOptions, stages: Stages
) -> LightMap:
    item = scene.objects[index]
    grid = SampleGrid(options.width_px, options.height_px, options.samples_per_side)
    faces = snap_uvs(mesh, grid)
    surface = SurfacePoints.of(mesh, options.threads)
    values = np.zeros((grid.height, grid.width, 3), np.float32)
    texel_faces = np.full((grid.height, grid.width), NO_FACE, np.int32)
    n_overlapping = 0
    step = rows_at_once(grid)
    name = f"bake {item.name}"
    with stages.stage(name, total=grid.width * grid.height, unit="texels") as advance:
        for first in range(0, grid.height, step):
            rows = range(first, min(first + step, grid.height))
            samples, overlaps = _samples_of(faces, grid, rows, options.threads)
            light = _light_of(surface, samples, lamps, item.receives_shadows, options.threads)
            _add_means(samples, light, rows, values, texel_faces)
            n_overlapping += overlaps
            advance(len(rows) * grid.width)
    has_data = texel_faces != NO_FACE
    with stages.part("pad"):
        charts = np.append(chart_ids(mesh), NO_FACE).astype(np.int32)[texel_faces]
        surroundings = Surroundings(charts, has_data, options)
        values = surroundings.filled(values, (0.0, 0.0, 0.0))
    return LightMap(
        index=index,
        name=item.name,
        values=values,
        has_data=has_data,
        n_overlapping=n_overlapping,
        n_outside=faces.n_outside_tile,
    )


def _samples_of(
    faces: SnappedFaces, grid: SampleGrid, rows: range, threads: int | None
) -> tuple[Samples, int]:
    owners, n_overlaps = rasterize_uv(faces, grid, rows, threads=threads)
    return owned_samples(owners, faces, grid, rows.start, threads=threads), n_overlaps


def _light_of(
    surface: SurfacePoints,
    samples: Samples,
    lamps: StaticLight,
    receives: bool,
    threads: int | None,
) -> Floats:
    """(n, 3) float32: light at samples, some of them at a time."""
    light = np.empty((len(samples), 3), np.float32)

    def work(start: int, stop: int) -> None:
        part = Samples(*(array[start:stop] for array in samples.arrays()))
        points, normals, sides = surface.at(part)
        light[start:stop] = lamps.light_at(points, normals, sides, receives=receives)

    run_bands(work, len(samples), band=_BAND, threads=threads)
    return light


def _add_means(
    samples: Samples, light: Floats, rows: range, values: Floats, texel_faces: IntArray
) -> None:
    """Write the means of samples into their texels, and the face of the first of each."""
    width = values.shape[1]
    texels = samples.texel_ids - rows.start * width
    n_texels = len(rows) * width
    counts = np.bincount(texels, minlength=n_texels)
    here = slice(rows.start, rows.stop)
    for channel in range(3):
        sums = np.bincount(texels, weights=light[:, channel], minlength=n_texels)
        values[here, :, channel] = (sums / np.maximum(counts, 1)).reshape(len(rows), width)
    texel_faces[here].reshape(-1)[texels[::-1]] = samples.faces[::-1]
