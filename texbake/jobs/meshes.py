"""What is in a mesh file."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from texbake.errors import FileFormatError
from texbake.files import PathLike
from texbake.mapping.distortion import Distortion, distortion
from texbake.mapping.options import UnwrapOptions
from texbake.mesh.files import read_mesh
from texbake.mesh.files.contents import FileContents, read_contents
from texbake.mesh.files.source import parsed_once
from texbake.mesh.info import MeshInfo, mesh_info
from texbake.progress import ProgressSink
from texbake.texture.image import image_shape


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshFileInfo:
    """What `info_file` measured."""

    mesh: MeshInfo
    distortion: Distortion | None = None  # of the texture coordinates, where it was to be measured
    # what a glTF, FBX, OBJ or USD file says besides its surface
    contents: FileContents | None = None
    # width, height and channels of its images by name; None for one that cannot be read
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
    """Count and measure what is in a mesh file."""
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
