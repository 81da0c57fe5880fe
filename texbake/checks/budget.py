"""Limits of programs, as findings: triangles, image size, texels per meter, file size.

The limits are those of `texbake.targets`.
"""

from __future__ import annotations

import math
from dataclasses import field
from pathlib import Path

import numpy as np

from texbake.checks.checked_mesh import CheckedMesh, Finding
from texbake.errors import FileFormatError, TexbakeError, first_few
from texbake.files import PathLike
from texbake.mapping.corner_uvs import has_measurable_uvs
from texbake.records import dataclass
from texbake.targets import PROGRAMS
from texbake.texture.image import image_shape


@dataclass(frozen=True, kw_only=True)
class AssetFile:
    """What a model file holds besides its mesh."""

    n_bytes: int  # with its buffers and images
    # Width and height of the images that can be read, by name.
    images: dict[str, tuple[int, int]] = field(default_factory=dict)
    unread: tuple[str, ...] = ()  # why the others cannot, a sentence each
    meters_per_unit: float = 1.0

    @classmethod
    def of(cls, path: PathLike) -> AssetFile:
        """Measure a file; it has been read as a mesh before."""
        from texbake.mesh.files.contents import model_bytes, read_contents

        try:
            contents = read_contents(path)
        except TexbakeError:  # a damaged material is no problem of the mesh
            contents = None
        if contents is None:
            return cls(n_bytes=Path(path).stat().st_size)
        images, unread = {}, []
        for name, data in contents.images.items():
            try:
                if data is None:
                    unread.append(f"{name}: it is missing, or outside the folder of the file")
                else:
                    images[name] = image_shape(data, name)[:2]
            except FileFormatError as error:
                unread.append(str(error))
        return cls(
            n_bytes=model_bytes(path, contents.images.values()),
            images=images,
            unread=tuple(unread),
            meters_per_unit=contents.meters_per_unit or 1.0,
        )


def budget_findings(checked: CheckedMesh, file: AssetFile | None) -> list[Finding | None]:
    """Findings about a mesh beyond the limits of the program of the profile."""
    options, mesh = checked.options, checked.mesh
    assert options.profile is not None
    target = PROGRAMS[options.profile]
    limits, images = target.limits, {} if file is None else file.images
    found: list[Finding | None] = []
    if limits.triangles is not None and mesh.n_faces > limits.triangles:
        found.append(
            checked.finding(
                "too-many-triangles", mesh.n_faces, most=limits.triangles, title=target.title
            )
        )
    unread = () if file is None else file.unread
    reasons = "; ".join(first_few(unread))
    found.append(checked.finding("unreadable-images", len(unread), reasons=reasons))
    large = [name for name, size in images.items() if max(size) > limits.texture]
    found.append(
        checked.finding(
            "large-images", len(large), names=", ".join(first_few(large)), most=limits.texture
        )
    )
    if file is not None and limits.n_bytes is not None and file.n_bytes > limits.n_bytes:
        size, most = file.n_bytes / 1e6, limits.n_bytes / 1e6
        found.append(checked.finding("large-file", 1, size=size, most=most, title=target.title))
    largest = max(images.values(), key=math.prod, default=(options.width_px, options.height_px))
    density = _texels_per_meter(checked, largest, 1.0 if file is None else file.meters_per_unit)
    if limits.texels_per_meter is not None and density < limits.texels_per_meter:
        found.append(
            checked.finding(
                "few-texels-per-meter", 1, density=density, least=limits.texels_per_meter,
                width=largest[0], height=largest[1],
            )
        )  # fmt: skip
    return found


def _texels_per_meter(checked: CheckedMesh, size: tuple[int, int], meters_per_unit: float) -> float:
    """Return the mean of a mesh; infinite where there is nothing to measure."""
    if not (checked.has_coordinates and has_measurable_uvs(checked.mesh)):
        return math.inf
    area = float(checked.areas.sum()) / checked.scale**2 * meters_per_unit**2
    texels = float(np.abs(checked.uv_areas).sum()) * math.prod(size)
    return math.sqrt(texels / area) if area > 0.0 else math.inf
