"""Objects of a scene file: reads or generates meshes, maps and transforms them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

from pydantic import Discriminator, Tag

from texbake.core import portable_math as pm
from texbake.errors import OptionError, quoted
from texbake.files import PathLike
from texbake.mapping.options import METHODS, UnwrapOptions
from texbake.mesh.files import read_mesh
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.mesh.normals import with_flat_normals
from texbake.mesh.parametric.make import make
from texbake.mesh.parametric.options import SHAPES, MakeOptions
from texbake.progress import Progress
from texbake.records import dataclass
from texbake.rendering.scene.file.materials import MaterialOf, Matrix, ProjectorMatrix
from texbake.rendering.scene.file.tables import Table, built_by, described, table, types_of_fields
from texbake.rendering.scene.file.values import (
    File,
    Text,
    Vector,
    Whole,
    at,
    choice,
    nearest,
    numbers,
)
from texbake.rendering.scene.gltf import read_gltf_scene
from texbake.rendering.scene.material import Material
from texbake.rendering.scene.scene import SceneObject, check_transform, transform_matrix
from texbake.texture.image import read_image

# Shapes other than parametric ones, and the keys that they take.
PLAIN_SHAPES: dict[str, tuple[str, ...]] = {
    "cube": (),
    "icosphere": ("level",),
    "orange": ("n_triangles",),
}
MAX_SCENE_TRIANGLES = 6_000_000
"""Triangles that the shapes of a scene file may have together; they take about 1.2 GB."""
GLTF_SUFFIXES = (".glb", ".gltf")

MappingTable = table(
    UnwrapOptions,
    {"method": choice(tuple(METHODS)), "matrix": ProjectorMatrix},
    name="Mapping",
    without=("normals", "angle"),
    required=("method",),
    short="method",
)


def _mapping(matrix: FloatArray | None = None, **values: Any) -> UnwrapOptions:
    if matrix is not None:
        values["matrix"] = tuple(map(tuple, matrix.tolist()))
    return UnwrapOptions(**values)


_MATERIAL = Annotated[
    Annotated[Text, Tag("<name>")] | Annotated[MaterialOf, Tag("<table>")],
    Discriminator(lambda value: "<name>" if isinstance(value, str) else "<table>"),
]
_SHAPE_KEYS = {
    **types_of_fields(MakeOptions, {"profile": File, "patches": File, "image": File}),
    "level": described(Whole, "Number of times that the triangles of an icosphere are divided."),
    "n_triangles": described(Whole, "Approximate number of triangles of an orange."),
}
_TRANSFORM_KEYS = {
    "translate": described(Vector, "Where the object is moved to, in model units."),
    "rotate": described(Vector, "Angles in degrees about x, then y, then z."),
    "scale": described(numbers(3, or_one=True), "Factor of the object's size, or one per axis."),
    "matrix": described(Matrix, "4 x 4 numbers in place of the other three, or their file."),
}

ObjectTable = table(
    SceneObject,
    name="Object",
    without=("mesh", "mapping", "material", "transform"),
    more={
        "mesh": described(File, "Mesh file of the object, relative to the scene file."),
        "shape": described(
            choice((*SHAPES, *PLAIN_SHAPES)), "Surface that is made in place of a mesh file."
        ),
        **_SHAPE_KEYS,
        "mapping": described(
            built_by(MappingTable, _mapping), "New texture coordinates for the mesh."
        ),
        **_TRANSFORM_KEYS,
        "material": described(_MATERIAL, "Name of a material of this file, or a table of its own."),
    },
)


@dataclass
class ObjectMaker:
    """Makes the objects of a scene file."""

    path: PathLike  # path of the scene file, for messages
    materials: Mapping[str, Material]  # materials by name
    progress: Progress = None
    # Features of the objects' files that are not supported
    notes: list[str] = field(default_factory=list)
    # Further files that the objects' files refer to
    files: list[Path] = field(default_factory=list)
    _meshes: dict[Path, Mesh] = field(default_factory=dict)
    _names: set[str] = field(default_factory=set)
    _numbers: dict[str, int] = field(default_factory=dict)
    _n_triangles: int = 0

    def build(self, index: int, found: Table) -> list[SceneObject]:
        """Build the objects of one table: a single object, or all objects of a glTF file."""
        values = found.set_values()
        steps = "objects", index
        with at(self.path, *steps):
            transform = _transform(values)
            _check_source(values)
        material = self._material(steps, values.get("material"))
        flags = {key: values[key] for key in _FLAGS if key in values}
        if _is_whole_scene(values):
            with at(self.path, *steps, "mesh"):
                scene = read_gltf_scene(values["mesh"], progress=self.progress)
            self.notes += scene.notes
            self.files += scene.files
            return [
                replace(item, transform=_compose(transform, item.transform), **flags)
                for item in scene.objects
            ]
        mesh = self._mesh(steps, values)
        name = self._free_name(values.get("name") or Path(mesh.name).stem)
        if material is not None and not isinstance(values["material"], str):
            material = replace(material, name=name)
        return [
            SceneObject(
                mesh=mesh,
                mapping=values.get("mapping"),
                material=material or Material(name=name),
                transform=transform,
                name=name,
                **flags,
            )
        ]

    def _material(self, steps: tuple[str, int], material: str | Material | None) -> Material | None:
        if isinstance(material, str):
            with at(self.path, *steps):
                if material not in self.materials:
                    known = nearest(material, self.materials)
                    advice = known if self.materials else "the file has no [materials.NAME]"
                    raise OptionError(f"material: there is no {quoted(material)}; {advice}")
            return self.materials[material]
        return material

    def _mesh(self, steps: tuple[str, int], values: Mapping[str, Any]) -> Mesh:
        if "mesh" not in values:
            with at(self.path, *steps):
                return self._shape(values)
        path: Path = values["mesh"]
        if path not in self._meshes:
            with at(self.path, *steps, "mesh"):
                self._meshes[path] = read_mesh(path, progress=self.progress)
        return self._meshes[path]

    def _free_name(self, name: str) -> str:
        free, n = name, self._numbers.get(name, 1)
        while free in self._names:
            n += 1
            free = f"{name} {n}"
        self._numbers[name] = n  # so that many objects of one name do not try all names before
        self._names.add(free)
        return free

    def _shape(self, values: Mapping[str, Any]) -> Mesh:
        """Make a shape, if all shapes of the scene together do not get too large."""
        options = _shape_options(values)
        is_known = not options.keys() & {"image", "patches", "profile"}
        if is_known:
            self._count(_shape_size(values["shape"], options))
        mesh = _make_shape(values["shape"], options)
        if not is_known:
            self._count(mesh.n_faces)
        return mesh

    def _count(self, n_triangles: int) -> None:
        self._n_triangles += n_triangles
        if self._n_triangles > MAX_SCENE_TRIANGLES:
            raise OptionError(
                f"shape: with it, the shapes of this scene have {self._n_triangles:,} triangles; "
                f"{MAX_SCENE_TRIANGLES:,} are the most; make a file with `texbake make`, and name "
                "it as the mesh"
            )


_FLAGS = ("casts_shadows", "receives_shadows", "visible")


def _is_whole_scene(values: Mapping[str, Any]) -> bool:
    """Whether an object is a whole glTF file with its own materials."""
    return (
        "mesh" in values
        and values["mesh"].suffix.lower() in GLTF_SUFFIXES
        and not values.keys() & {"material", "mapping"}
    )


def _check_source(values: Mapping[str, Any]) -> None:
    if ("mesh" in values) == ("shape" in values):
        raise OptionError(
            "shape: it conflicts with the mesh; give only one"
            if "mesh" in values
            else "mesh: it is missing; give mesh = 'FILE' or shape = 'NAME'"
        )
    if "mesh" in values:
        for key in values:
            if key in _SHAPE_KEYS:
                raise OptionError(f"{key}: it belongs to a shape, and this object has a mesh")


def _transform(values: Mapping[str, Any]) -> FloatArray | None:
    parts = {key: values[key] for key in ("translate", "rotate", "scale") if key in values}
    if "matrix" in values:
        if parts:
            raise OptionError(f"{next(iter(parts))}: it conflicts with the matrix; give only one")
        return check_transform(values["matrix"], "matrix")
    return check_transform(transform_matrix(**parts), "scale") if parts else None


def _compose(outer: FloatArray | None, inner: FloatArray | None) -> FloatArray | None:
    if outer is None or inner is None:
        return inner if outer is None else outer
    return pm.matmul(outer, inner)


def _shape_options(values: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a shape, all of which it takes."""
    shape: str = values["shape"]
    options = {key: values[key] for key in values if key in _SHAPE_KEYS}
    of_others = set(_SHAPE_KEYS) if shape in PLAIN_SHAPES else {"level", "n_triangles"}
    for key in options:
        if key in of_others.difference(PLAIN_SHAPES.get(shape, ())):
            raise OptionError(f"{key}: the shape {shape} does not use it")
    return options


def _shape_size(shape: str, options: dict[str, Any]) -> int:
    """About how many triangles a shape has, found without making it."""
    if shape == "cube":
        return 12
    if shape == "icosphere":
        return int(20 * 4 ** min(options.get("level", 3), 20))
    if shape == "orange":
        return int(options.get("n_triangles", 1_000_000))
    n_u, n_v = MakeOptions(**options).settings(shape)["resolution"]
    return int(2 * max(n_u, options.get("sides") or 0) * n_v)


def _make_shape(shape: str, options: dict[str, Any]) -> Mesh:
    if shape in PLAIN_SHAPES:
        mesh: Mesh = getattr(import_module("texbake.mesh.shapes"), shape)(**options)
        # Smooth shading would round the edges of a cube.
        return with_flat_normals(mesh) if shape == "cube" else mesh
    if "image" in options:
        options["image"] = read_image(options["image"], color=False).pixels
    return make(shape, MakeOptions(**options))
