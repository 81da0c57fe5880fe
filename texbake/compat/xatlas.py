"""The API of xatlas-python, with texbake's own unwrap.

    import texbake.compat.xatlas as xatlas

Arguments, results and exceptions are those of xatlas-python 0.0.11. A mesh is unwrapped by
`texbake.unwrap`, so its charts are the same at any size and position of the model. The
options say what differs: those that control how xatlas grows and places charts have no effect.

Based on: Markus Worchel, xatlas-python, 2020; Jonathan Young, xatlas, 2018.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from texbake.baking.texels import NO_FACE, SampleGrid, rasterize_uv, snap_uvs
from texbake.compat.xatlas_options import (
    AddMeshError as AddMeshError,
    ArrayError as ArrayError,
    Chart as Chart,
    ChartOptions as ChartOptions,
    ChartType as ChartType,
    NoImageError as NoImageError,
    PackOptions as PackOptions,
)
from texbake.errors import OptionError, UnwrapError
from texbake.files import replacing
from texbake.mapping.corner_uvs import signed_areas, surface_areas
from texbake.mapping.options import UnwrapOptions
from texbake.mapping.seams import chart_ids
from texbake.mapping.unwrap import unwrap_together
from texbake.mesh.interchange import plain_array
from texbake.mesh.mesh import Float32Array, FloatArray, IntArray, Mesh
from texbake.mesh.normals import degenerate_faces
from texbake.records import dataclass

__version__ = "0.0.11"

_UNSIZED = 1024  # texels of a side where neither a resolution nor a density is given
_ROOM = 1.1  # factor by which a texture grows until the charts fit at a given density
_MOST_ATLASES = 100
_HARD = 1000.0  # `normal_seam_weight` above this cuts charts at all hard edges

UintArray = npt.NDArray[np.uint32]
MeshArrays = tuple[UintArray, UintArray, Float32Array]


@dataclass(frozen=True, eq=False)
class _Packed:
    """A mesh of a generated atlas."""

    mesh: Mesh  # with texture coordinates in units of one atlas each
    charts: IntArray  # (F,) chart of each face
    atlases: IntArray  # (F,) atlas of each face
    n_charts: int

    def arrays(self) -> tuple[UintArray, UintArray, Float32Array, npt.NDArray[np.intp]]:
        """Vertices of the atlas, faces, texture coordinates, and a face of each vertex."""
        assert self.mesh.uvs is not None and self.mesh.uv_faces is not None
        vertices, places = self.mesh.faces.ravel(), self.mesh.uv_faces.ravel()
        keys = vertices.astype(np.int64) << 32 | places
        _, first, faces = np.unique(keys, return_index=True, return_inverse=True)
        uvs = self.mesh.uvs[places[first]].astype(np.float32)
        ids = faces.reshape(-1, 3).astype(np.uint32)
        return vertices[first].astype(np.uint32), ids, uvs, first // 3


class Atlas:
    """Meshes that share one texture."""

    def __init__(self) -> None:
        self._meshes: list[Mesh] = []
        self._materials: list[UintArray] = []
        self._of_uvs = False
        self._packed: list[_Packed] = []
        self._size = (0, 0)
        self._images: list[npt.NDArray[np.uint8]] | None = None

    def add_mesh(self, positions: Any, indices: Any, normals: Any = None, uvs: Any = None) -> None:
        """Add a mesh: (V, 3) positions, (F, 3) indices, (V, 3) normals, (V, 2) uvs."""
        points = _array("Position", positions, 3, np.float64)
        faces = _array("Index", indices, 3, np.uint32)
        fields: dict[str, Any] = {}
        if normals is not None:
            vectors = _array("Normal", normals, 3, np.float32, len(points))
            fields |= {"normals": vectors, "normal_faces": faces}
        if uvs is not None:
            places = _array("Texture coordinate", uvs, 2, np.float32, len(points))
            fields |= {"uvs": places, "uv_faces": faces}
        if self._meshes and self._of_uvs:
            raise AddMeshError("Adding mesh failed: meshes and UV meshes do not share an atlas")
        self._add(points, faces, fields, np.zeros(len(faces), np.uint32))

    def add_uv_mesh(self, uvs: Any, indices: Any, face_materials: Any = None) -> None:
        """Add charts that are only packed: (V, 2) uvs, (F, 3) indices, (F, 1) materials."""
        places = _array("Texture coordinate", uvs, 2, np.float32)
        faces = _array("Index", indices, 3, np.uint32)
        materials = np.zeros(len(faces), np.uint32)
        if face_materials is not None:
            materials = _array("Face material ID", face_materials, 1, np.uint32, len(faces))[:, 0]
        if self._meshes and not self._of_uvs:
            raise AddMeshError("Adding mesh failed: meshes and UV meshes do not share an atlas")
        points = np.column_stack([places, np.zeros(len(places))])
        self._add(points, faces, {"uvs": places, "uv_faces": faces}, materials)
        self._of_uvs = True

    def _add(
        self, points: FloatArray, faces: UintArray, fields: dict[str, Any], materials: UintArray
    ) -> None:
        if len(points) == len(faces) == 0:
            return
        if len(faces) == 0:
            raise AddMeshError("Adding mesh failed: Invalid index count")
        if faces.max() >= len(points):
            raise AddMeshError("Adding mesh failed: Index out of range")
        name = f"mesh {len(self._meshes)}"
        fields |= {"positions": points, "faces": faces}
        self._meshes.append(Mesh(name=name, **fields))
        self._materials.append(materials)

    def generate(
        self,
        chart_options: ChartOptions | None = None,
        pack_options: PackOptions | None = None,
        verbose: bool = False,
    ) -> None:
        """Unwrap the meshes into one texture, or into several of one size."""
        if not self._meshes:
            return
        charts, pack = chart_options or ChartOptions(), pack_options or PackOptions()
        if not isinstance(charts, ChartOptions) or not isinstance(pack, PackOptions):
            raise TypeError("generate: give ChartOptions, then PackOptions")
        keep = self._of_uvs or charts.use_input_mesh_uvs
        options = UnwrapOptions(
            size=pack.resolution or _UNSIZED,
            padding=max(pack.padding, int(pack.bilinear)),
            quality="best" if pack.bruteForce else "good",
            keep=bool(keep and all(mesh.uvs is not None for mesh in self._meshes)),
            seams_at_hard_edges=charts.normal_seam_weight > _HARD and not keep,
        )
        empty = [bool(degenerate_faces(mesh).all()) for mesh in self._meshes]
        solid = [mesh for mesh, is_empty in zip(self._meshes, empty, strict=True) if not is_empty]
        meshes = [mesh for mesh, _ in unwrap_together(solid or self._meshes, options)]
        if pack.texels_per_unit > 0.0:
            keeping = replace(options, keep=True, seams_at_hard_edges=False)
            meshes, options = _at_density(meshes, keeping, pack)
        packed, self._size = _placed(meshes, options, crop=not pack.resolution)
        rest = iter(packed)
        self._packed = [
            _without_charts(mesh) if is_empty else next(rest)
            for mesh, is_empty in zip(self._meshes, empty, strict=True)
        ]
        self._images = list(self._drawn()) if pack.create_image else None
        if verbose:
            print(f"--- Generated Atlas ---\nUtilization: {100.0 * self.utilization:f}%")
            print(f"Charts: {self.chart_count}\nSize: {self.width}x{self.height}\n")

    @property
    def width(self) -> int:
        """Width of each texture in texels."""
        return self._size[0]

    @property
    def height(self) -> int:
        """Height of each texture in texels."""
        return self._size[1]

    @property
    def mesh_count(self) -> int:
        """Number of meshes that were unwrapped."""
        return len(self._packed)

    @property
    def chart_count(self) -> int:
        """Number of charts of all meshes."""
        return sum(item.n_charts for item in self._packed)

    @property
    def atlas_count(self) -> int:
        """Number of textures."""
        return max((int(item.atlases.max()) + 1 for item in self._packed), default=0)

    @property
    def texels_per_unit(self) -> float:
        """Texels per unit of length, of all charts together."""
        solid = sum(
            surface_areas(item.mesh.positions[item.mesh.faces]).sum() for item in self._packed
        )
        flat = sum(self._texels(item).sum() for item in self._packed)
        return math.sqrt(flat / solid) if solid else 0.0

    @property
    def utilization(self) -> float:
        """Share of the first texture that faces cover."""
        return self.get_utilization(0)

    @property
    def chart_image(self) -> npt.NDArray[np.uint8]:
        """(H, W, 3) picture of the charts of the first texture; see `PackOptions.create_image`."""
        return self.get_chart_image(0)

    def get_utilization(self, atlas_index: int) -> float:
        """Return the share of a texture that faces cover."""
        self._check_atlas(atlas_index)
        texels = (self._texels(item)[item.atlases == atlas_index].sum() for item in self._packed)
        return min(float(sum(texels)) / (self.width * self.height), 1.0)

    def get_chart_image(self, atlas_index: int) -> npt.NDArray[np.uint8]:
        """Return a (H, W, 3) picture of the charts of a texture."""
        self._check_atlas(atlas_index)
        if self._images is None:
            raise NoImageError("The atlas does not have an image.")
        return self._images[atlas_index]

    def get_mesh(self, mesh_index: int) -> MeshArrays:
        """Return the vertex that each vertex of the atlas was, faces, and texture coordinates."""
        return self._mesh(mesh_index).arrays()[:3]

    __getitem__ = get_mesh

    def __len__(self) -> int:
        return self.mesh_count

    def get_mesh_vertex_assignment(self, mesh_index: int) -> tuple[UintArray, UintArray]:
        """Return the texture and the chart of each vertex of the atlas."""
        item = self._mesh(mesh_index)
        faces = item.arrays()[3]
        return item.atlases[faces].astype(np.uint32), item.charts[faces].astype(np.uint32)

    def get_mesh_chart_count(self, mesh_index: int) -> int:
        """Return the number of charts of a mesh."""
        return self._mesh(mesh_index).n_charts

    def get_mesh_chart(self, mesh_index: int, chart_index: int) -> Chart:
        """Return a chart of a mesh."""
        item = self._mesh(mesh_index)
        if _index(chart_index) >= item.n_charts:
            raise IndexError(
                f"Chart index {chart_index} out of bounds for mesh with {item.n_charts} charts."
            )
        faces = np.flatnonzero(item.charts == chart_index).astype(np.uint32)
        return Chart(faces, int(item.atlases[faces[0]]), int(self._materials[mesh_index][faces[0]]))

    def _mesh(self, index: int) -> _Packed:
        n = len(self._packed)
        if _index(index) >= n:
            raise IndexError(f"Mesh index {index} out of bounds for atlas with {n} meshes.")
        return self._packed[index]

    def _check_atlas(self, index: int) -> None:
        if _index(index) >= self.atlas_count:
            raise IndexError(f"Atlas index {index} out of bounds.")

    def _texels(self, item: _Packed) -> FloatArray:
        """(F,) area of each face in the texture, in texels."""
        return np.abs(signed_areas(item.mesh.corner_uvs())) * (self.width * self.height)

    def _drawn(self) -> Iterator[npt.NDArray[np.uint8]]:
        """Draw each texture, a color for each chart."""
        grid = SampleGrid(self.width, self.height, 1)
        colors = np.random.default_rng(0).integers(96, 256, (self.chart_count, 3), np.uint8)
        for atlas in range(self.atlas_count):
            image = np.zeros((self.height, self.width, 3), np.uint8)
            first = 0
            for item in self._packed:
                here = item.atlases == atlas
                if here.any():
                    part = item.mesh.replace(
                        faces=item.mesh.faces[here], uv_faces=item.mesh.uv_faces[here],  # type: ignore[index]
                        normals=None, normal_faces=None,
                    )  # fmt: skip
                    owners, _ = rasterize_uv(snap_uvs(part, grid), grid)
                    covered = owners != NO_FACE
                    image[covered] = colors[first + item.charts[here][owners[covered]]]
                first += item.n_charts
            yield image


def parametrize(positions: Any, indices: Any, normals: Any = None, uvs: Any = None) -> MeshArrays:
    """Unwrap one mesh; see `Atlas.add_mesh` and `Atlas.get_mesh`."""
    atlas = Atlas()
    atlas.add_mesh(positions, indices, normals, uvs)
    atlas.generate()
    if not len(atlas):
        empty = np.zeros(0, np.uint32)
        return empty, empty.reshape(0, 3), np.zeros((0, 2), np.float32)
    return atlas.get_mesh(0)


def export(
    path: str, positions: Any, indices: Any = None, uvs: Any = None, normals: Any = None
) -> None:
    """Write an OBJ file whose vertices have one index for all of their attributes."""
    if not isinstance(path, str):
        raise TypeError(f"path: {path!r} is not a string")
    points = _array("Position", positions, 3, np.float32)
    columns = [("v", points)]
    if normals is not None:
        columns.append(("vn", _array("Normal", normals, 3, np.float32, len(points))))
    if uvs is not None:
        columns.append(("vt", _array("Texture coordinates", uvs, 2, np.float32, len(points))))
    lines = [
        f"{key} {' '.join(f'{number:g}' for number in row)}"
        for key, rows in columns
        for row in rows.tolist()
    ]
    if indices is not None:
        corner = {(0, 0): "{0}", (1, 0): "{0}/{0}", (0, 1): "{0}//{0}", (1, 1): "{0}/{0}/{0}"}
        pattern = corner[uvs is not None, normals is not None]
        faces = _array("Index", indices, 3, np.uint32).astype(np.int64) + 1
        lines += [f"f {' '.join(pattern.format(i) for i in face)}" for face in faces.tolist()]
    try:
        with replacing(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise ArrayError(f"Cannot open path {path}") from error


def _array(name: str, value: Any, width: int, dtype: type, n: int | None = None) -> Any:
    """Return an array (n, width); raise what xatlas raises for others."""
    try:
        with np.errstate(invalid="ignore"):
            array: npt.NDArray[Any] = np.ascontiguousarray(plain_array(value, name).astype(dtype))
    except OptionError as error:
        raise TypeError(str(error)) from error
    if array.ndim != 2 or array.shape[1] != width:
        raise ArrayError(f"{name} array expected to be Nx{width}.")
    if n is not None and len(array) != n:
        raise ArrayError(
            f"{name} array has invalid number of elements in the first dimension (expected {n}, "
            f"got {len(array)})"
        )
    return array


def _index(value: Any) -> int:
    if not hasattr(value, "__index__") or value.__index__() < 0:
        raise TypeError(f"{value!r} is not an index of 0 or more")
    return int(value.__index__())


def _without_charts(mesh: Mesh) -> _Packed:
    """Return a mesh without area, whose faces lie in no chart and no atlas."""
    none = np.full(mesh.n_faces, -1, np.int32)
    return _Packed(mesh.replace(uvs=np.zeros((1, 2)), uv_faces=0 * mesh.faces), none, none, 0)


def _at_density(
    meshes: list[Mesh], options: UnwrapOptions, pack: PackOptions
) -> tuple[list[Mesh], UnwrapOptions]:
    """Pack the charts of meshes again with given texels per unit; also return the options."""
    options = replace(options, texel_density=pack.texels_per_unit, tiles=_MOST_ATLASES)
    if not pack.resolution:
        packed, size = _placed(meshes, options, crop=False)
        found = Atlas()
        found._packed, found._size = packed, size
        side = math.ceil(_UNSIZED * pack.texels_per_unit / found.texels_per_unit)
        options = replace(options, tiles=1, size=side + 2 * (options.padding or 0))
    while True:
        try:
            return [mesh for mesh, _ in unwrap_together(meshes, options)], options
        except UnwrapError:
            if pack.resolution:
                raise
            options = replace(options, size=math.ceil(_ROOM * options.width_px))


def _placed(
    meshes: list[Mesh], options: UnwrapOptions, *, crop: bool
) -> tuple[list[_Packed], tuple[int, int]]:
    """Take meshes out of their UDIM tiles, and crop a texture to what they use."""
    size, padding = options.width_px, options.padding or 0
    packed, used = [], np.array([1, 1])
    for mesh in meshes:
        assert mesh.uvs is not None and mesh.uv_faces is not None
        tiles = np.floor(mesh.corner_uvs().mean(axis=1)).astype(np.int32)
        uvs = mesh.uvs.copy()
        of_uvs = np.zeros_like(uvs)
        of_uvs[mesh.uv_faces] = tiles[:, np.newaxis]
        uvs -= of_uvs
        used = np.maximum(used, np.ceil(uvs.max(axis=0) * size + padding).astype(int))
        charts = chart_ids(mesh)
        atlases = tiles[:, 0] + 10 * tiles[:, 1]
        packed.append(_Packed(mesh.replace(uvs=uvs), charts, atlases, int(charts.max()) + 1))
    if not crop:
        return packed, (size, size)
    width, height = np.minimum(used, size).tolist()
    scale = np.array([size / width, size / height])
    cropped = [replace(p, mesh=p.mesh.replace(uvs=p.mesh.uvs * scale)) for p in packed]
    return cropped, (width, height)
