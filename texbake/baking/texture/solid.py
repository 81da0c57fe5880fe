"""A solid procedure baked into a texture: each texel takes the value at its point in space.

Based on: Perlin, "An image synthesizer", SIGGRAPH 1985; Peachey, "Solid texturing of complex
surfaces", SIGGRAPH 1985.
"""

from __future__ import annotations

import numpy as np

from texbake.baking.rays import RayField
from texbake.baking.texture.canvas import TextureBake, TextureCanvas, greatest_lengths, sample_steps
from texbake.baking.texture.options import SolidOptions
from texbake.errors import MeshError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.interchange import MeshLike, as_mesh
from texbake.mesh.mesh import Mesh
from texbake.progress import Progress
from texbake.texture.image_files import read_volume
from texbake.texture.lookup import ramp_lookup, volume_lookup
from texbake.texture.procedures import evaluate
from texbake.texture.procedures.options import COLORED_PROCEDURES, MEASURING_PROCEDURES

_LEAST_SIZE = 2.0**-1022  # in model units; what float64 can divide 2 by


def bake_solid(
    mesh: MeshLike, options: SolidOptions | None = None, *, progress: Progress = None
) -> TextureBake:
    """Bake a solid procedure into the texture of a mesh."""
    mesh = as_mesh(mesh)
    options = options or SolidOptions()
    ramp = None if options.colors is None else np.asarray(options.colors, np.float32)
    volume = (
        read_volume(options.volume if len(options.volume) > 1 else options.volume[0])
        if options.volume
        else None
    )
    n_channels = 3 if ramp is not None or options.procedure in COLORED_PROCEDURES else 1
    if volume is not None and ramp is None:
        n_channels = volume.shape[3]
    canvas = TextureCanvas(mesh, options, n_channels, progress)
    frame = LocalFrame.around(mesh)
    scale = np.broadcast_to(np.asarray(_scale(mesh, options)), 3)
    # Rays of length 0 start on the surface.
    field = RayField(mesh, frame, kind="face", front=0.0, back=0.0, threads=options.threads)
    with np.errstate(over="ignore", invalid="ignore"):  # such points and widths count as 0
        scaled = mesh.positions[mesh.faces] * scale
        widths = greatest_lengths(sample_steps(mesh, scaled, canvas.grid)).astype(np.float32)
    corner = mesh.bounds[0] if volume is not None and options.scale is None else np.zeros(3)
    for band in canvas.bands():
        with canvas.stages.part("evaluate"):
            points = field.rays(band.samples).origins
            with np.errstate(over="ignore"):
                places = (points / frame.scale + frame.center - corner) * scale
            if volume is not None:
                results = volume_lookup(volume, places, wrap="clamp", threads=options.threads)
            else:
                results = evaluate(
                    options.procedure,
                    places,
                    widths[band.samples.faces],
                    parameters=options.parameters,
                    scalar=ramp is not None,
                    threads=options.threads,
                )
            if ramp is not None:
                results = ramp_lookup(ramp, results[:, 0], threads=options.threads)
            counts = band.counts()
            means = band.sums(results) / np.maximum(counts, 1)[:, None]
            canvas.put(band, means, counts > 0)
    source = "volume" if options.volume else options.procedure
    return canvas.finish(source, scale=tuple(scale.tolist()))


def _scale(mesh: Mesh, options: SolidOptions) -> float | tuple[float, float, float]:
    if options.scale is not None:
        return options.scale
    if options.procedure in MEASURING_PROCEDURES and not options.volume:
        return 1.0
    low, high = mesh.bounds
    longest = float((high - low).max())
    if 0.0 < longest < _LEAST_SIZE:
        raise MeshError(
            f"{mesh.name}: it is {longest:.3g} model units across, too small for a procedure; "
            "scale it up with: texbake transform --scale"
        )
    return (1.0 if options.volume else 2.0) / longest if longest > 0.0 else 1.0
