"""What every job does with its outputs: checked before the work, written whole, listed afterwards.

A job takes paths and options and returns a `JobResult`. It prints nothing, and raises a
`TexbakeError` where its caller is at fault: before the work begins if that can be known by then.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from texbake.errors import FileFormatError, OptionError, counted, quoted
from texbake.files import PathLike, check_folder, check_writable, replacing
from texbake.records import dataclass

if TYPE_CHECKING:
    from texbake.mesh.mesh import Mesh

Report = TypeVar("Report")

# As texbake writes these, they hold positions and faces, and nothing else.
BARE_MESH_SUFFIXES = (".stl", ".off")
TRIANGLE_SUFFIXES = (".stl", ".glb")
_PAGE_SUFFIXES = (".html", ".htm")


@dataclass(frozen=True, kw_only=True, eq=False)
class JobResult(Generic[Report]):
    """What a job wrote and measured."""

    files: tuple[Path, ...]  # every file that was written, the main one first
    report: Report  # the figures of the job
    warnings: tuple[str, ...] = ()  # what the user should look at, a sentence each

    def to_json(self) -> dict[str, Any]:
        """Return the figures as plain values."""
        return self.report.to_json()  # type: ignore[attr-defined, no-any-return]


def write_report(path: PathLike, report: Mapping[str, Any]) -> None:
    """Write figures as JSON; the file appears whole or not at all."""
    text = json.dumps(plain_figures(report), indent=2, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def plain_figures(value: Any) -> Any:
    """Plain values for JSON: None for NaN and infinities, text for paths."""
    if isinstance(value, Mapping):
        return {key: plain_figures(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_figures(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value


def present_paths(*paths: PathLike | None) -> tuple[Path, ...]:
    """Return the paths that are not None."""
    return tuple(Path(path) for path in paths if path is not None)


def check_picture(path: PathLike | None) -> None:
    """Raise if an 8-bit picture could not be written to a path; None passes."""
    if path is not None:
        from texbake.texture.image_formats import check_image_format

        check_image_format(path)
        check_writable(path)


def check_mesh(path: PathLike, *, folder_is_made: bool = False) -> None:
    """Raise if a mesh could not be written, but for a folder that the job makes."""
    from texbake.mesh.files import WRITABLE_MESH_SUFFIXES

    suffix = Path(path).suffix
    if suffix.lower() not in WRITABLE_MESH_SUFFIXES:
        known = ", ".join(WRITABLE_MESH_SUFFIXES)
        raise FileFormatError(f"{path}: meshes cannot be written as {quoted(suffix)}; use {known}")
    if not folder_is_made:
        check_writable(path)


def check_page(path: PathLike | None) -> None:
    """Raise if a page could not be written to a path, or its suffix is another's; None passes."""
    if path is not None:
        suffix = Path(path).suffix
        if suffix.lower() not in _PAGE_SUFFIXES:
            raise FileFormatError(
                f"{path}: a page cannot be written as {quoted(suffix)}; use .html"
            )
        check_writable(path)


def check_layout(path: PathLike) -> None:
    """Raise if a layout could not be written to a path."""
    suffix = Path(path).suffix
    if suffix.lower() not in (".png", ".svg"):
        raise FileFormatError(
            f"{path}: layouts cannot be written as {quoted(suffix)}; use .png or .svg"
        )
    check_writable(path)


# By the kinds of `texbake.verbs.verb.Writes`.
OUTPUT_CHECKS: dict[str, Callable[..., None]] = {
    "mesh": check_mesh, "picture": check_picture, "page": check_page, "drawing": check_layout,
    "report": check_writable, "hits": check_writable, "image": check_writable,
    "folder": check_folder, "images": lambda path: None,
}  # fmt: skip

SUFFIXES_OF_UV_SETS = (".glb", ".obj")


def check_uv_set(outputs: Sequence[Path]) -> None:
    """Raise `OptionError` where a file has no place for a further set of texture coordinates."""
    for path in outputs:
        if path.suffix.lower() not in SUFFIXES_OF_UV_SETS:
            raise OptionError(
                f"uv_set: {path.suffix} files have one set of texture coordinates; write a .glb or "
                "an .obj file"
            )


def uv_set_files(mesh: Mesh, output: PathLike) -> tuple[Path, ...]:
    """Return the file beside an OBJ file that holds the further sets of a mesh, if it has any."""
    from texbake.mesh.files.obj_write import uv_sets_path

    has_file = mesh.uv_sets and Path(output).suffix.lower() == ".obj"
    return (uv_sets_path(output),) if has_file else ()


def triangle_notes(mesh: Mesh, output: PathLike) -> tuple[str, ...]:
    """Say that polygons are written as triangles, if the format of `output` has only those."""
    if mesh.polygon_of is None or Path(output).suffix.lower() not in TRIANGLE_SUFFIXES:
        return ()
    count = f"{counted(mesh.n_polygons, 'polygon')} became {mesh.n_faces:,}"
    return (f"{output}: written as triangles: {count}",)


def check_distinct(
    outputs: Sequence[PathLike | None], inputs: Sequence[PathLike | None] = ()
) -> None:
    """Raise if two outputs are one file, or overwrite an input; None passes."""
    read = {os.path.realpath(path) for path in inputs if path is not None}
    written = set()
    for path in outputs:
        if path is not None:
            file = os.path.realpath(path)
            if file in written:
                raise OptionError(f"{path}: two outputs have this name; give each its own")
            if file in read:
                raise OptionError(f"{path}: it is also an input; give the output another name")
            written.add(file)
