"""Mesh files made from other mesh files, or from nothing, and what is in them."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeGuard

from texbake.errors import FileFormatError
from texbake.files import PathLike, appearing_together
from texbake.jobs.outputs import (
    JobResult,
    check_distinct,
    check_mesh,
    check_report,
    given,
    write_report,
)
from texbake.mapping.corner_uvs import check_measurable
from texbake.mapping.distortion import Distortion, distortion
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.files import read_mesh, write_mesh
from texbake.mesh.files.contents import FileContents, read_contents
from texbake.mesh.files.source import parsed_once
from texbake.mesh.info import MeshInfo, mesh_info
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import smooth_normals
from texbake.mesh.parametric.make import make
from texbake.mesh.parametric.options import MakeOptions
from texbake.mesh.remesh_options import RemeshOptions
from texbake.mesh.shapes import orange
from texbake.progress import ProgressSink
from texbake.texture.image import image_shape, read_image

if TYPE_CHECKING:
    from texbake.mesh.remesh_report import RemeshReport

ORANGE = "orange"


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFileInfo:
    """What `info_file` measured.

    Attributes
    ----------
    mesh : MeshInfo
    distortion : Distortion, optional
        Of the texture coordinates, where it was to be measured.
    contents : FileContents, optional
        What a glTF, FBX, OBJ or USD file says besides its surface.
    image_shapes : dict
        Width, height and channels of its images by name; None for one that cannot be read.
    """

    mesh: MeshInfo
    distortion: Distortion | None = None
    contents: FileContents | None = None
    image_shapes: dict[str, tuple[int, int, int] | None] = field(default_factory=dict)

    def to_json(self) -> str:
        """Return everything as JSON."""
        figures = json.loads(self.mesh.to_json())
        if self.contents is not None:
            figures |= {
                "materials": [asdict(material) for material in self.contents.materials],
                "images": self.image_shapes,
                "uv_sets": self.contents.uv_sets,
                "meters_per_unit": self.contents.meters_per_unit,
                "up": self.contents.up,
                "passed_over": self.contents.passed_over,
            }
        if self.distortion is not None:
            figures["distortion"] = self.distortion.to_json()
        return json.dumps(figures, indent=2, allow_nan=False)


def info_file(
    mesh: PathLike,
    *,
    uv_size: int | tuple[int, int] | None = None,
    progress: ProgressSink | None = None,
) -> MeshFileInfo:
    """Count and measure what is in a mesh file.

    Parameters
    ----------
    mesh
    uv_size
        Texels of the texture for which the texture coordinates are measured as well. None leaves
        them out.
    progress
        Receives the stages.

    Raises
    ------
    TexbakeError
        As `read_mesh` does.
    UvError
        `uv_size` is given, and the mesh has no texture coordinates.
    """
    size = None if uv_size is None else UnwrapOptions(size=uv_size).size
    with parsed_once():
        read = read_mesh(mesh, progress=progress)
        contents = read_contents(mesh)
    images = {} if contents is None else contents.images
    return MeshFileInfo(
        mesh=mesh_info(read),
        distortion=None if size is None else distortion(read, size),
        contents=contents,
        image_shapes={name: _shape(data, name) for name, data in images.items()},
    )


def _shape(data: bytes | None, name: str) -> tuple[int, int, int] | None:
    """Width, height and channels of an image; None where it is missing or cannot be read."""
    try:
        return None if data is None else image_shape(data, name)
    except FileFormatError:
        return None


@dataclass(frozen=True, kw_only=True)
class Relief:
    """A procedure that raises a surface along its smooth normals, which cannot tear it.

    Attributes
    ----------
    procedure : str
        Such as `worley`; its values are in 0 to 1.
    height : float
        How far a value of 1 raises the surface, in model units; a negative one sinks it.
    scale : float
        Factor of positions for the procedure.
    """

    procedure: str
    height: float = 0.02
    scale: float = 8.0


@appearing_together()
def make_file(
    shape: str,
    output: PathLike,
    options: MakeOptions | None = None,
    *,
    triangles: int = 100_000,
    relief: Relief | None = None,
    threads: int | None = None,
) -> JobResult[Mesh]:
    """Make a mesh of a parametric surface or of an orange, and write it.

    Parameters
    ----------
    shape
        A name that `make` knows, such as `torus`; or `orange`.
    output
        The mesh file.
    options
        `profile`, `patches` and `image` may be paths. None for the defaults of the shape.
    triangles
        About how many an orange has.
    relief
        A procedure to raise the surface by; the mesh then loses normals of its own.
    threads
        None for every processor.

    Returns
    -------
    JobResult of Mesh
        The report is the mesh itself.

    Raises
    ------
    MeshError
        Areas of the mesh, or their squares, would leave the range of float64.
    """
    options = options or MakeOptions()
    if shape != ORANGE:
        options.settings(shape)  # raises what is wrong with them
    sources = [options.profile, options.patches, options.image]
    check_distinct([output], [path for path in sources if _is_path(path)])
    check_mesh(output)
    if shape == ORANGE:
        mesh = orange(triangles)
    else:
        if _is_path(options.image):
            pixels = read_image(options.image, color=False, threads=threads).pixels
            options = replace(options, image=pixels)
        mesh = make(shape, options)
    if relief is not None:
        mesh = _raised(mesh, relief, threads)
    check_measurable(mesh)
    write_mesh(mesh, output)
    return JobResult(files=given(output), report=mesh)


def _is_path(value: Any) -> TypeGuard[PathLike]:
    return isinstance(value, str | os.PathLike)


def _raised(mesh: Mesh, relief: Relief, threads: int | None) -> Mesh:
    from texbake.texture.procedures.evaluation import evaluate

    points = mesh.positions * relief.scale
    values = evaluate(relief.procedure, points, scalar=True, threads=threads)
    raised = relief.height * values.astype(float)
    normals = smooth_normals(mesh, threads=threads)
    return mesh.replace(
        positions=mesh.positions + raised * normals, normals=None, normal_faces=None
    )


@appearing_together()
def remesh_file(
    mesh: PathLike,
    output: PathLike,
    options: RemeshOptions | None = None,
    *,
    report: PathLike | None = None,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> JobResult[RemeshReport]:
    """Wrap a mesh file in a closed surface, or remesh an open one, and write the result.

    Parameters
    ----------
    mesh
    output
        The new mesh; it may replace `mesh`.
    options, threads, progress
        As for `remesh`.
    report
        File for the figures as JSON.
    """
    from texbake.mesh.remesh import remesh_with_report

    check_mesh(output)
    check_distinct([output, report])
    check_distinct([report], [mesh])
    check_report(report)
    given_mesh = read_mesh(mesh, progress=progress)
    wrapped, figures = remesh_with_report(given_mesh, options, threads=threads, progress=progress)
    write_mesh(wrapped, output)
    if report is not None:
        write_report(report, figures.to_json())
    return JobResult(files=given(output, report), report=figures, warnings=figures.notes)
