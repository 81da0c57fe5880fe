"""A bake of many parts while it goes on: part after part onto one set of maps after another.

One part's dense mesh and ray tree are held at a time, and are kept for the next set of maps if that
begins with the part that was the last; so tiles of one mesh are baked with one tree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from texbake.baking.bake import bake_inputs
from texbake.baking.inputs import BakeInputs
from texbake.baking.maps.kind import MapKind
from texbake.baking.options import BakeOptions
from texbake.baking.parts.canvas import CanvasMaps
from texbake.baking.parts.dense import DenseMeshes
from texbake.baking.parts.light import (
    BoolArray,
    Canvas,
    Layout,
    LightPart,
)
from texbake.baking.parts.matching import Matching
from texbake.baking.parts.options import PartsOptions
from texbake.baking.parts.pieces import Piece
from texbake.baking.parts.report import PartFigures, PartsReport, called
from texbake.baking.parts.result import PartsResult
from texbake.baking.ray_maps import RayMaps
from texbake.baking.report import DistanceSummary
from texbake.baking.result import BakeResult
from texbake.baking.trace import open_trees
from texbake.baking.trees import Trees
from texbake.errors import UvError
from texbake.mesh.frame import LocalFrame
from texbake.mesh.mesh import FloatArray, Mesh
from texbake.progress import Stages
from texbake.raycast.scene import RayScene

# Images that change the rays of a set of maps.
RayMapsOf = Callable[[Canvas], RayMaps | None]


@dataclass(eq=False)
class Work:
    """A bake of many parts while it goes on.

    Attributes
    ----------
    inputs, trees
        Of the part in hand, whose place is `part`.
    """

    kinds: list[MapKind]
    options: BakeOptions
    dense: DenseMeshes
    light: list[LightPart]
    stages: Stages
    ray_maps: RayMapsOf
    is_tiled: bool
    part: int | None = None
    inputs: BakeInputs | None = None
    trees: Trees | None = None
    frame: LocalFrame | None = None
    occluders: Mesh | None = None
    around: RayScene | None = None
    figures: list[PartFigures] = field(default_factory=list)
    without: list[str] = field(default_factory=list)

    def see(self, pieces: list[Piece], low: Sequence[Mesh]) -> None:
        """Let secondary rays meet other parts than the match, if any are cast."""
        if all(kind.needs == "hits" for kind in self.kinds):
            return
        self.occluders, _ = self.dense.joined(pieces)
        self.frame = LocalFrame.around(self.occluders, *low)
        with self.stages.stage("build ray tree", total=self.occluders.n_faces, unit="triangles"):
            self.around = RayScene.build(self.occluders, self.frame, threads=self.options.threads)

    def bake(
        self, layout: Layout, matching: Matching | None, parts: PartsOptions, folder: Path | None
    ) -> PartsResult:
        """Bake all sets of maps."""
        done: dict[Canvas, BakeResult] = {}
        n_overlapping = 0
        try:
            for i, (canvas, faces) in enumerate(layout.faces.items()):
                place = None if folder is None else folder / str(i)
                if place is not None:
                    place.mkdir()
                maps, result = self._canvas(canvas, faces, place)
                if result is not None:
                    done[canvas] = result
                n_overlapping += maps.n_overlapping
        finally:
            self._close()
            if self.around is not None:
                self.around.close()
        if not done:
            raise UvError(
                f"{self.light[0].mesh.name}: its texture coordinates cover no texel of any map; "
                "use a greater --size or new coordinates"
            )
        report = PartsReport(
            options=parts,
            matching=matching,
            parts=self.figures,
            canvases={canvas: result.report for canvas, result in done.items()},
            n_crossing=layout.n_crossing,
            n_outside=layout.n_outside,
            n_overlapping=n_overlapping,
            without_texel=tuple(self.without),
            stages=self.stages.records,
        )
        return PartsResult(done, report)

    def _canvas(
        self, canvas: Canvas, faces: dict[int, BoolArray], folder: Path | None
    ) -> tuple[CanvasMaps, BakeResult | None]:
        """Bake one set of maps; None if no part covers a texel of it."""
        maps = CanvasMaps(self.kinds, self.options, is_tile=self.is_tiled)
        distances = DistanceSummary()
        images = self.ray_maps(canvas)
        for i, chosen in faces.items():
            part = self.light[i]
            inputs = self._take(i).with_low(part.on(chosen, canvas.udim))
            try:
                result = bake_inputs(
                    self.kinds, inputs, part.cage, images, self.stages, self.trees, distances
                )
            except UvError:
                self.without.append(f"{part.name} covers no texel of {called(canvas) or 'the map'}")
                continue
            self.inputs = inputs
            maps.add(result, inputs, int(chosen.sum()))
            report = result.report
            self.figures.append(
                PartFigures(
                    canvas, part.name, tuple(piece.name for piece in part.sources),
                    int(chosen.sum()), report.texels_covered, report.texels_missed,
                    report.front, report.back,
                )
            )  # fmt: skip
        if self.inputs is None or maps.is_empty:
            return maps, None
        finished = self.inputs.with_options(self.options)
        return maps, maps.finish(finished, self.stages, folder)

    def _take(self, i: int) -> BakeInputs:
        """Have a part in hand: its dense mesh, and the tree over it."""
        if self.part == i and self.inputs is not None:
            return self.inputs
        self._close()
        part = self.light[i]
        high, materials = self.dense.joined(part.sources)
        options = replace(self.options, padding=0, fill="none")
        inputs = BakeInputs(high, part.mesh, options, materials, known_bounds=self._bounds())
        trees = open_trees(
            high,
            part.mesh,
            self.stages,
            frame=self.frame,
            chunk_faces=options.chunk_faces(high.n_faces, part.mesh.n_faces),
            threads=options.threads,
        )
        trees.occluders, trees.around = self.occluders, self.around
        self.part, self.inputs, self.trees = i, inputs, trees
        return inputs

    def _bounds(self) -> FloatArray | None:
        """(2, 3) float64: the box that positions are coded into, the same for all parts."""
        if len(self.light) == 1:
            return None
        boxes = [mesh.bounds for mesh in (*self.dense.meshes, *(part.mesh for part in self.light))]
        lows, highs = zip(*boxes, strict=True)
        return np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])

    def _close(self) -> None:
        if self.trees is not None:
            self.trees.close()
        self.part = self.inputs = self.trees = None
