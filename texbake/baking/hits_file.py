"""The hits of a bake in a file, from which other maps are made without the high-poly mesh or rays.

An uncompressed .npz with 40 to 60 bytes per sample, the low-poly mesh, and the faces of the
high-poly mesh that were hit, with all their attributes and the files of their images.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from texbake.arrays import DAMAGE, read_arrays, write_arrays
from texbake.baking.hits import Hits
from texbake.baking.inputs import BakeInputs
from texbake.baking.report import BakeReport
from texbake.baking.result import BakeResult
from texbake.baking.texels import NO_FACE
from texbake.errors import FileError, FileFormatError, OptionError
from texbake.files import PathLike, require_file
from texbake.mesh.compose import used_rows
from texbake.mesh.materials import CHANNELS, ChannelImage, ChannelSource, Materials, MeshMaterial
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import shading_normals
from texbake.raycast.rays import N_COLUMNS, NO_HIT
from texbake.texture.lookup import WRAPS

if TYPE_CHECKING:
    from pydantic import TypeAdapter

Arrays = dict[str, Any]  # of arrays

_VERSION = 3
_MESH_ARRAYS = ("positions", "faces", "uvs", "uv_faces", "normals", "normal_faces", "tangents",
                "colors", "polygon_of", "face_groups")  # fmt: skip
_IMAGE_FIELDS = ("name", "components", "wraps", "placing", "uv_set", "is_nearest")


def write_hits(result: BakeResult, path: PathLike) -> None:
    """Write the hits of a bake to a file, completely or not at all."""
    if result.hits is None or result.inputs is None:
        raise OptionError("hits: the bake kept none; bake with `keep_hits=True`")
    hits, high = _reduced_to_hit_faces(result.hits, result.inputs)
    arrays: Arrays = {
        field.name: column
        for field in fields(Hits)
        if (column := getattr(hits, field.name)) is not None
    }
    arrays["texel_faces"] = result.texel_faces
    arrays["bounds"] = result.inputs.bounds
    arrays["curvatures"] = high.high_surface.curvatures
    if high.high_surface.known_tangents is not None:
        arrays["tangents"] = high.high_surface.known_tangents
    header: dict[str, Any] = {
        "version": _VERSION,
        "report": json.loads(_report_type().dump_json(result.report)),
    }
    for part, mesh in (("high", high.high), ("low", high.low)):
        header[part] = {"name": mesh.name, "group_names": mesh.group_names}
        if mesh.group_objects:
            header[part]["group_objects"] = mesh.group_objects
        for name in _MESH_ARRAYS:
            if (array := getattr(mesh, name)) is not None:
                arrays[f"{part}_mesh_{name}"] = array
    if high.materials is not None:
        header["materials"] = _pack_materials(high.materials, arrays)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    write_arrays(path, arrays)


def read_hits(path: PathLike) -> BakeResult:
    """Read a file of `write_hits`, as the result of a bake without maps."""
    require_file(path)
    try:
        arrays = read_arrays(path)
        header = json.loads(arrays["header"].tobytes())
        if header["version"] != _VERSION:
            raise FileFormatError(
                f"{path}: it has version {header['version']}, and this texbake reads version "
                f"{_VERSION}; bake it again"
            )
        return _unpack(header, arrays)
    except (FileFormatError, MemoryError):
        raise
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except DAMAGE as error:
        raise FileFormatError(
            f"{path}: it is not a file of hits, or it is damaged; bake again and keep the hits"
        ) from error


def _reduced_to_hit_faces(hits: Hits, inputs: BakeInputs) -> tuple[Hits, BakeInputs]:
    """Hits and inputs reduced to the high-poly faces that were hit, or to one face if none was."""
    high = inputs.high
    used = np.zeros(high.n_faces, dtype=np.bool_)
    used[hits.high_faces[hits.is_hit]] = True
    used[0] |= not used.any()
    chosen = np.flatnonzero(used)
    numbers = np.append(np.cumsum(used, dtype=np.int32) - 1, NO_HIT)
    columns = {field.name: getattr(hits, field.name) for field in fields(Hits)}
    columns["high_faces"] = numbers[hits.high_faces].astype(np.int32)  # NO_HIT is the last
    vertices, faces = used_rows(high.faces[chosen], high.n_vertices)
    normals, normal_faces = shading_normals(high, threads=inputs.options.threads)
    normal_rows, normal_faces = used_rows(normal_faces[chosen], len(normals))
    part: dict[str, Any] = {
        "positions": high.positions[vertices],
        "faces": faces,
        "normals": normals[normal_rows],
        "normal_faces": normal_faces,
        "group_names": high.group_names,
        "group_objects": high.group_objects,
        "name": high.name,
    }
    materials = inputs.materials
    uv_rows = np.zeros(0, np.intp)
    if high.uvs is not None and high.uv_faces is not None:
        uv_rows, part["uv_faces"] = used_rows(high.uv_faces[chosen], len(high.uvs))
        part["uvs"] = high.uvs[uv_rows]
    if high.colors is not None:
        part["colors"] = high.colors[vertices]
    if high.face_groups is not None:
        part["face_groups"] = high.face_groups[chosen]
    if materials is not None:
        materials = materials.of_faces(chosen, uv_rows)
    curvatures = inputs.high_surface.curvatures[vertices]
    tangents = None
    if inputs.has_normal_maps:
        if high.tangents is None:
            tangents = inputs.high_surface.tangents[chosen]
        else:
            part["tangents"] = high.tangents[chosen]
    reduced = BakeInputs.of(
        Mesh(**part),
        inputs.low,
        inputs.options,
        materials,
        known_curvatures=curvatures,
        known_tangents=tangents,
        known_bounds=inputs.bounds,
    )
    return Hits(**columns), reduced


def _pack_materials(materials: Materials, arrays: Arrays) -> dict[str, Any]:
    """Add the arrays of materials; return their entry in the header."""
    arrays["face_materials"] = materials.face_materials
    for number, coordinates in materials.uv_sets.items():
        arrays[f"uv_set_{number}"] = coordinates
    names: list[str] = []
    for source in (s for m in materials.materials for s in m.channels.values()):
        if source.image is not None and source.image.name not in names:
            arrays[f"image_{len(names)}"] = np.frombuffer(source.image.data, dtype=np.uint8)
            names.append(source.image.name)
    found = []
    for material in materials.materials:
        channels: dict[str, Any] = {}
        for name, source in material.channels.items():
            image = None
            if source.image is not None:
                image = {f: getattr(source.image, f) for f in _IMAGE_FIELDS}
                image["data"] = names.index(source.image.name)
            channels[name] = [source.factor, image, source.offset]
        found.append({"name": material.name, "channels": channels})
    return {
        "materials": found,
        "uv_sets": list(materials.uv_sets),
        "has_vertex_colors": materials.has_vertex_colors,
    }


def _unpack(header: dict[str, Any], arrays: Arrays) -> BakeResult:
    report = _report_type().validate_python(header["report"])
    high, low = (
        Mesh(
            **{
                name: arrays[f"{part}_mesh_{name}"]
                for name in _MESH_ARRAYS
                if f"{part}_mesh_{name}" in arrays
            },
            group_names=tuple(header[part]["group_names"]),
            group_objects=tuple(header[part].get("group_objects", ())),
            name=header[part]["name"],
        )
        for part in ("high", "low")
    )
    columns: Arrays = {
        field.name: arrays[field.name] if field.default is MISSING else arrays.get(field.name)
        for field in fields(Hits)
    }
    hits = Hits(**columns)
    texel_faces = arrays["texel_faces"]
    options = report.options
    _check(hits, arrays, high, low, (options.height_px, options.width_px))
    has_data = np.zeros(texel_faces.size, dtype=np.bool_)
    has_data[hits.texel_ids[hits.is_hit]] = True
    inputs = BakeInputs.of(
        high,
        low,
        options,
        _unpack_materials(header, arrays),
        known_curvatures=arrays["curvatures"],
        known_tangents=arrays.get("tangents"),
        known_bounds=arrays["bounds"],
    )
    return BakeResult({}, report, hits, texel_faces, has_data.reshape(texel_faces.shape), inputs)


def _unpack_materials(header: dict[str, Any], arrays: Arrays) -> Materials | None:
    if "materials" not in header:
        return None
    stored = header["materials"]
    return Materials(
        face_materials=arrays["face_materials"],
        materials=tuple(
            MeshMaterial(
                name=item["name"],
                channels={
                    name: _unpack_source(name, stored, arrays)
                    for name, stored in item["channels"].items()
                },
            )
            for item in stored["materials"]
        ),
        uv_sets={number: arrays[f"uv_set_{number}"] for number in stored["uv_sets"]},
        has_vertex_colors=stored["has_vertex_colors"],
    )


def _unpack_source(channel: str, stored: list[Any], arrays: Arrays) -> ChannelSource:
    factor, of_image, offset = stored
    width = len(CHANNELS[channel].default)
    if len(factor) != width or not np.isfinite([*factor, offset]).all():
        raise ValueError("a factor has another shape")
    if of_image is None:
        return ChannelSource(tuple(factor), None, offset)
    components, wraps, placing = (of_image[name] for name in ("components", "wraps", "placing"))
    number = of_image["uv_set"]
    if number != 0 and f"uv_set_{number}" not in arrays:
        raise ValueError("an image lies on texture coordinates that are not there")
    if len(components) != width or not set(components) <= {0, 1, 2, 3}:
        raise ValueError("an image has other components")
    if not set(wraps) <= set(WRAPS):
        raise ValueError("an image has unknown wrapping")
    if np.shape(placing) != (2, 3) or not np.isfinite(placing).all():
        raise ValueError("an image has no place")
    image = {
        **of_image,
        "data": arrays[f"image_{of_image['data']}"].tobytes(),
        "components": tuple(components),
        "wraps": tuple(wraps),
        "placing": tuple(map(tuple, placing)),
    }
    return ChannelSource(tuple(factor), ChannelImage(**image), offset)


def _check(hits: Hits, arrays: Arrays, high: Mesh, low: Mesh, shape: tuple[int, int]) -> None:
    """Raise `ValueError` for shapes, types and indices that kernels do not expect."""
    n, n_uvs = len(hits), 0 if high.uvs is None else len(high.uvs)
    expected: dict[str, tuple[tuple[int, ...], type]] = {
        "texel_ids": ((n,), np.int32),
        "low_faces": ((n,), np.int32),
        "low_barycentrics": ((n, 2), np.float32),
        "high_faces": ((n,), np.int32),
        "high_barycentrics": ((n, 2), np.float32),
        "offsets": ((n, 3), np.float32),
        "secondary": ((n, N_COLUMNS), np.float32),
        "texel_faces": (shape, np.int32),
        "curvatures": ((high.n_vertices, 1), np.float32),
        "tangents": ((high.n_faces, 3, 4), np.float32),
        "bounds": ((2, 3), np.float64),
    }
    for name, array in arrays.items():
        if name.startswith("uv_set_"):
            expected[name] = (n_uvs, 2), np.float64
            if not np.isfinite(array).all():
                raise ValueError("texture coordinates are not finite")
        if name in expected and (array.shape, array.dtype) != expected[name]:
            raise ValueError(f"{name} has another shape or type")
    materials = arrays.get("face_materials")
    if materials is not None and materials.shape != (high.n_faces,):
        raise ValueError("there is not one material for each face")
    for ids, least, stop in (
        (hits.texel_ids, 0, shape[0] * shape[1]),
        (hits.low_faces, 0, low.n_faces),
        (hits.high_faces, NO_HIT, high.n_faces),
        (arrays["texel_faces"], NO_FACE, low.n_faces),
    ):
        if ids.size and not (ids.min() >= least and ids.max() < stop):
            raise ValueError("an index is out of range")


@cache
def _report_type() -> TypeAdapter[BakeReport]:
    from pydantic import TypeAdapter

    return TypeAdapter(BakeReport)
