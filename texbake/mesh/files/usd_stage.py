"""USD stages: opened with errors of one line, and the values that their meshes carry, by corner.

usd-core, Pixar's own wheel, is optional: `pip install 'texbake[usd]'`. What opens a stage runs in a
process of its own; see `reader_process`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from texbake.child import LIMITS
from texbake.errors import DependencyError, FileFormatError
from texbake.files import PathLike, require_file
from texbake.limits import file_beside, is_within
from texbake.mesh.weld import unique_corners


def require_usd(path: PathLike) -> None:
    """Raise `DependencyError` where USD cannot be read or written."""
    try:
        import pxr.Usd  # noqa: F401
    except ImportError as error:
        raise DependencyError(
            f"{path}: USD files need usd-core; pip install 'texbake[usd]', or use a .glb file"
        ) from error


def open_stage(path: PathLike) -> Any:
    """Open a .usd, .usda, .usdc or .usdz file with what it refers to."""
    require_file(path)
    require_usd(path)
    from pxr import Sdf, Usd

    if Path(path).stat().st_size == 0:
        raise FileFormatError(f"{path}: the file is empty; write it again")
    with reporting_damage(path):
        # Not through the registry of layers, which would give what the file held when it was
        # last opened.
        layer = Sdf.Layer.FindOrOpen(str(path))
        if layer is not None:
            layer.Reload(True)
        stage = Usd.Stage.Open(str(path))
    if stage is None:
        raise FileFormatError(f"{path}: it is not a USD file; export it again")
    for used in stage.GetUsedLayers():
        if used.realPath:
            file_beside(path, used.realPath)
    return stage


@contextmanager
def reporting_damage(path: PathLike) -> Iterator[None]:
    """Turn what the library complains of into `FileFormatError`.

    Values are read when they are first used, so that a stage which could be opened may still turn
    out to be damaged.
    """
    from pxr import Tf

    try:
        yield
    except (Tf.ErrorException, UnicodeDecodeError) as error:
        raise FileFormatError(
            f"{path}: it is not a USD file, or damaged: {_reason(error)}; export it again"
        ) from None


def layers_of_stage(path: str) -> Iterator[Any]:
    """Layers that a file is composed of, and lie in its folder; the limits grow with each."""
    from pxr import Sdf, Tf

    folder = Path(path).parent
    seen = {os.path.realpath(path)}
    waiting = [str(path)]
    while waiting:
        with suppress(Tf.ErrorException, UnicodeDecodeError):  # is reported when it is read
            layer = Sdf.Layer.FindOrOpen(waiting.pop())
            if layer is None:
                continue
            yield layer
            for name in layer.GetCompositionAssetDependencies():
                place = layer.ComputeAbsolutePath(name)
                file = place.partition("[")[0]  # of a package, the package itself
                real = os.path.realpath(file)
                if place and is_within(folder, file) and Path(file).is_file():
                    if real not in seen:
                        LIMITS.allow(Path(file).stat().st_size)
                    if place not in seen:
                        waiting.append(place)
                    seen |= {real, place}


def files_of_stage(path: str) -> list[str]:
    """Files that a USD file is composed of, and those that it names; its own name is left out.

    Images in tiles are those that exist.
    """
    from pxr import Tf, UsdUtils

    unheard = UsdUtils.CoalescingDiagnosticDelegate()  # silences warnings of missing files
    try:
        layers, assets, missing = UsdUtils.ComputeAllDependencies(path)
    except Tf.ErrorException:
        return []
    finally:
        del unheard
    names = [*(layer.realPath for layer in layers), *assets, *missing]
    return [str(name) for name in names if name and Path(name) != Path(path)]


def numbers_of(path: PathLike, values: Any, kind: type[np.generic]) -> npt.NDArray[Any]:
    """Return what the library has read, which may be anything, as an array of a kind of number."""
    try:
        with np.errstate(invalid="ignore"):  # NaN that signals is NaN like any other
            return np.array(values, kind)
    except (TypeError, ValueError, OverflowError):
        raise FileFormatError(
            f"{path}: it holds {type(values).__name__} where numbers belong; export it again"
        ) from None


_LONGEST = 200  # characters of a reason


def _reason(error: Exception) -> str:
    """Return what the library complained of first, and of that the beginning.

    There may be a complaint for each byte of the file, each as long as the file.
    """
    try:
        complaint = str(getattr(error.args[0], "commentary", error))
    except UnicodeDecodeError:  # it repeats what it could not read
        complaint = "it holds text that is not UTF-8"
    return " ".join(complaint[:_LONGEST].split()) or "no reason was given"


# Types of texture coordinates; the dedicated types come first.
_PAIRS = ("texCoord2f[]", "texCoord2d[]", "texCoord2h[]", "float2[]", "double2[]", "half2[]")


@dataclass(frozen=True, eq=False)
class UsdCorners:
    """Corners of a mesh's polygons, one after another, and those of its triangles."""

    path: PathLike  # of the file, for messages
    # point_of, polygon_of: (C,) int64; point and polygon of each corner.
    point_of: npt.NDArray[np.int64]
    polygon_of: npt.NDArray[np.int64]
    slots: npt.NDArray[np.int64]  # (F, 3) int64; corner of each corner of the triangles
    n_points: int

    def elements(self, interpolation: str) -> npt.NDArray[np.int64]:
        """(C,) element that each corner takes its value from."""
        if interpolation == "faceVarying":
            return np.arange(len(self.point_of))
        if interpolation == "uniform":
            return self.polygon_of
        return 0 * self.point_of if interpolation == "constant" else self.point_of

    def fail(self, prim: Any, name: str, what: str) -> NoReturn:
        """Raise `FileFormatError` about a primvar."""
        raise FileFormatError(f"{self.path}: {prim.GetPath()}: {name}: {what}; export it again")


def read_primvars(prim: Any, corners: UsdCorners) -> dict[str, Any]:
    """Fields of `Mesh` for those texture coordinates, normals and tangents that exist."""
    fields: dict[str, Any] = {}
    uvs = _values(prim, texture_coordinates(prim), corners, 2)
    if uvs is not None:
        fields["uvs"], fields["uv_faces"] = uvs
    normals = _values(prim, _normals(prim), corners, 3)
    if normals is not None:
        fields["normals"], fields["normal_faces"] = normals
    tangents = _values(prim, _primvar(prim, "tangents"), corners, 4)
    if tangents is not None:
        values, faces = tangents
        fields["tangents"] = values[faces]
    return fields


def read_colors(prim: Any, corners: UsdCorners) -> dict[str, Any]:
    """Field of `Mesh` for colors at points, with opacities; a color of the whole is none."""
    from pxr import Usd

    time = Usd.TimeCode.EarliestTime()
    columns = []
    for name, width in (("displayColor", 3), ("displayOpacity", 1)):
        primvar = _primvar(prim, name)
        if primvar is None or primvar.GetInterpolation() not in ("vertex", "varying"):
            break
        values = primvar.ComputeFlattened(time)
        if values is None or len(values) != corners.n_points:
            break
        columns.append(numbers_of(corners.path, values, np.float32).reshape(-1, width))
    return {"colors": np.concatenate(columns, axis=1)} if columns else {}


def _primvar(prim: Any, name: str) -> Any:
    from pxr import UsdGeom

    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    return primvar if primvar and primvar.HasValue() else None


def texture_coordinates(prim: Any) -> Any:
    """Return the primvar `st`, else the first that has two floats per corner; None where none."""
    from pxr import UsdGeom

    named = _primvar(prim, "st")
    if named is not None:
        return named
    primvars = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
    pairs = [p for p in primvars if str(p.GetTypeName()) in _PAIRS and p.HasValue()]
    return min(pairs, key=lambda p: _PAIRS.index(str(p.GetTypeName())), default=None)


def _normals(prim: Any) -> Any:
    """Return the primvar `normals`, which stands above the attribute; None where neither is."""
    from pxr import Usd, UsdGeom

    primvar = _primvar(prim, "normals")
    if primvar is not None:
        return primvar
    attribute = UsdGeom.Mesh(prim).GetNormalsAttr()
    return attribute if attribute.Get(Usd.TimeCode.EarliestTime()) else None


def _values(
    prim: Any, source: Any, corners: UsdCorners, width: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]] | None:
    """(n, width) values and (F, 3) indices into them; None where there is nothing.

    Values of corners that are listed one by one are welded where point and value agree.
    """
    if source is None:
        return None
    from pxr import Usd, UsdGeom

    name = source.GetName()
    time = Usd.TimeCode.EarliestTime()
    if isinstance(source, UsdGeom.Primvar):
        interpolation, indices = source.GetInterpolation(), source.GetIndices(time)
    else:
        interpolation, indices = UsdGeom.Mesh(prim).GetNormalsInterpolation(), None
    array = numbers_of(corners.path, source.Get(time), np.float64)
    if array.ndim != 2 or array.shape[1] != width:
        if name.endswith("tangents"):
            return None  # no rule of the format names them, and others may mean something else
        corners.fail(prim, name, f"it has the shape {array.shape}, not {width} numbers a value")
    elements = corners.elements(interpolation)
    if indices:
        table = numbers_of(corners.path, indices, np.int64)
        if len(elements) and elements.max() >= len(table):
            corners.fail(prim, name, f"it has {len(table)} indices for {elements.max() + 1} places")
        elements = table[elements]
    if len(elements) and (elements.min() < 0 or elements.max() >= len(array)):
        corners.fail(prim, name, f"it has {len(array)} values, and an index points outside of them")
    is_listed = interpolation == "faceVarying" and not indices
    if is_listed and len(array) != len(elements):
        corners.fail(prim, name, f"it has {len(array)} values for {len(elements)} corners")
    if is_listed and np.isfinite(array).all():
        array, numbers = unique_corners(corners.point_of, array)
        elements = numbers.astype(np.int64)
    return array, elements[corners.slots]
