"""The low-poly mesh of `run` and `lighten`: the high-poly mesh simplified as it is, or a wrap.

Of those that reach the number of triangles, pictures decide which is closest to the high-poly mesh.
"""

from __future__ import annotations

from dataclasses import replace

from texbake.baking.options import BakeOptions
from texbake.errors import MeshError, counted
from texbake.mapping.overlap import layout_notes
from texbake.mesh.hard_edges import LowNormals
from texbake.mesh.mesh import Mesh
from texbake.mesh.normals import with_visible_normals
from texbake.mesh.options import AUTO, CLOSED
from texbake.mesh.part_sizes import EnlargedParts, simplified_once
from texbake.mesh.repeated_parts import RepeatedParts
from texbake.mesh.simplify import SimplifyReport, check_count, measured_to, simplify_with_report
from texbake.mesh.topology import find_edges, genus, surface_side
from texbake.mesh.wrapping import FEW_FACES, Reason, reason_to_wrap, wraps
from texbake.progress import Progress, Stages
from texbake.records import dataclass
from texbake.rendering.compare import compare_shapes
from texbake.rendering.options import RenderOptions

# Width and height of the six pictures that decide. A pixel that shows another part counts as much
# as normals that differ by this angle, in degrees. A normal map leaves about this share of angles.
_PICTURE, _OTHER_PART, _WITH_MAP = 256, 90.0, 0.2
# Length of rays if tunnels were closed, as a share of the diagonal, and the length for up to
# `FEW_FACES` faces. Measured lengths reach into the deepest pore: bakes take ten times as long, and
# are no closer.
_RAYS, _RAYS_OF_FEW_FACES = 0.02, 0.04
# Other rays reach at most this many times as far as the low-poly mesh lies from the high-poly one.
# Longer ones find parts that were dropped, and other layers: displaced, these are spikes.
_SLANT, _LEAST_REACH = 2.0, 0.001  # the latter of the diagonal


@dataclass(frozen=True, kw_only=True)
class LowPoly:
    """A low-poly mesh, and how it was made."""

    mesh: Mesh
    report: SimplifyReport
    reach: float  # greatest length of the bake's rays, where it is measured
    is_of_wrap: bool = False
    # Why it was made from a wrap of the high-poly mesh, if no option asked for that, and which gaps
    # were closed.
    why: tuple[str, ...] = ()
    # Length of the bake's rays outside and inside of the low-poly mesh; None to measure it.
    ray_distance: float | None = None

    def aimed(self, options: BakeOptions) -> BakeOptions:
        """Return options of a bake with rays as long as this mesh needs."""
        if self.ray_distance is not None:
            return replace(options, front=self.ray_distance, back=self.ray_distance)
        return replace(options, max_reach=self.reach)


def reaching(low: Mesh, report: SimplifyReport) -> LowPoly:
    """Return a low-poly mesh whose rays reach as far as it needs."""
    apart = report.distance
    reach = max(_SLANT * apart.b_to_a.max, _LEAST_REACH * apart.diagonal)
    return LowPoly(mesh=low, report=report, reach=reach)


@dataclass(frozen=True, kw_only=True)
class LowPolyMaker:
    """Makes low-poly meshes of one high-poly mesh."""

    high: Mesh
    rule: LowNormals
    n_faces: int | None
    error: str | float | None = None
    quality: str
    seams: str = "auto"
    by_parts: bool = False  # whether small parts keep their share of the triangles
    parts: EnlargedParts | None = None  # of which `high` is the mesh
    # Parts of which `high` has one of each kind; `n_faces` counts all copies.
    repeated: RepeatedParts | None = None
    threads: int | None = None
    progress: Progress = None

    def make(self, remesh: str, *, must_reach: bool = True) -> LowPoly:
        """Reduce the mesh, or a wrap around it where that comes closer, to a number of faces."""
        if remesh == "always":
            low = self._choose_closest(self._simplify_wraps(None))
        else:
            low = self._simplify_or_wrap() if remesh == "auto" else self._simplify_high()
        if must_reach and self.error is None and not low.report.is_close_to_count:
            # With `auto`, closed surfaces around a mesh that is not open were tried.
            may_help = remesh == "never" or surface_side(self.high, threads=self.threads) == "both"
            closing = ", or use `remesh` always" if may_help and remesh != "always" else ""
            check_count(low.report.n_faces, self.n_faces, self.high.name, "request more" + closing)
        if low.is_of_wrap:
            report = measured_to(low.report, self.high, low.mesh, threads=self.threads)
            low = replace(low, report=report)
        return low

    def make_level(self, low: Mesh, finest: LowPoly, n_faces: int) -> LowPoly:
        """Reduce an unwrapped mesh, made as `finest`, further; what is left keeps its place."""
        level, report = simplify_with_report(
            low, n_faces, quality="best", seams="keep", threads=self.threads, progress=self.progress
        )
        check_count(level.n_faces, n_faces, low.name, "request more")
        notes = (*report.notes, *layout_notes(level, low, threads=self.threads))
        report = replace(report, notes=notes)
        level = self.rule.after_unwrap(self.rule.before_unwrap(level))
        level = with_visible_normals(level, threads=self.threads)
        made = reaching(level, measured_to(report, self.high, level, threads=self.threads))
        return replace(made, ray_distance=finest.ray_distance)

    def _simplify_or_wrap(self) -> LowPoly:
        n_faces, has_error = self.n_faces, self.error is not None
        if n_faces is not None and self.high.n_faces <= n_faces:
            return self._simplify_high()
        with Stages(self.progress).stage("look for an inside"):
            reason = reason_to_wrap(self.high, None if has_error else n_faces, threads=self.threads)
        from_high = None
        if reason is None:
            from_high = self._simplify_high()
            if has_error or from_high.report.is_whole:
                return from_high
            reason = Reason(f"{n_faces:,} triangles cannot show all of its holes and parts")
        try:
            candidates = self._simplify_wraps(reason)
        except MeshError:
            return from_high or self._simplify_high()
        is_certain = reason.is_certain and any(low.report.is_whole for low in candidates)
        if not (has_error or is_certain):
            candidates.append(from_high or self._simplify_high())
        return self._choose_closest(candidates)

    def _simplify(self, mesh: Mesh, quality: str) -> LowPoly:
        low, report = simplify_with_report(
            self.rule.to_simplify(mesh, self.high, threads=self.threads),
            self.n_faces,
            error=self.error,
            quality=quality,
            seams=self.seams,
            parts=self.parts,
            threads=self.threads,
            progress=self.progress,
        )
        return reaching(low, report)

    def _simplify_high(self) -> LowPoly:
        if self.repeated is not None and self.n_faces is not None:
            mesh, report, _ = simplified_once(
                self.repeated, self.n_faces, self._once, threads=self.threads
            )
            return reaching(mesh, report)
        if not self.by_parts:
            return self._simplify(self.high, self.quality)
        parts = EnlargedParts.of(self.high, threads=self.threads)
        return replace(self, high=parts.mesh, parts=parts, by_parts=False)._simplify_high()

    def _once(self, n_faces: int) -> tuple[Mesh, SimplifyReport, None]:
        low = replace(self, n_faces=n_faces, repeated=None)._simplify_high()
        return low.mesh, low.report, None

    def _simplify_wraps(self, reason: Reason | None) -> list[LowPoly]:
        """Make one mesh of each wrap."""
        candidates = wraps(
            self.high,
            self.n_faces if self.error is None else None,
            has_tunnels=reason is not None and reason.has_tunnels,
            surface=CLOSED if reason is None else AUTO,
            threads=self.threads,
            progress=self.progress,
        )
        return [self._of_wrap(*wrap, reason) for wrap in candidates]

    def _of_wrap(self, wrap: Mesh, width: float, n_left_out: int, reason: Reason | None) -> LowPoly:
        name, diagonal = self.high.name, self.high.diagonal
        # The vertices of a wrap are not vertices of the mesh, so they may move.
        simplified = self._simplify(wrap, "best" if width else self.quality)
        low = replace(simplified, is_of_wrap=True)
        why: list[str] = []
        if reason is not None:
            is_closed = surface_side(wrap, threads=self.threads) != "both"
            kind = "a closed surface around it" if is_closed else "a remeshed open surface"
            if self.error is not None:
                kind += ", which the error is measured from"
            why.append(
                f"{name}: {reason.text}; the low-poly mesh was made from {kind}; `remesh` never "
                "leaves it as it is"
            )
        if not width:
            return replace(low, why=tuple(why))
        n_tunnels = genus(low.mesh.faces, find_edges(low.mesh.faces), low.mesh.n_vertices)
        left = counted(n_tunnels or 0, "tunnel is", "tunnels are")
        why.append(
            f"{name}: gaps up to {100.0 * width / diagonal:.0f} % of its diagonal were closed"
            + ("" if n_tunnels is None else f", and {left} left")
        )
        if n_left_out:
            parts = counted(n_left_out, "part of the surface", "parts of the surface")
            why.append(f"{name}: left out {parts} with less area than a triangle has")
        few = self.n_faces is not None and self.n_faces <= FEW_FACES
        rays = (_RAYS_OF_FEW_FACES if few else _RAYS) * diagonal
        rays = max(rays, low.report.distance.b_to_a.max)  # very few faces lie farther from the wrap
        return replace(low, why=tuple(why), ray_distance=rays)

    def _choose_closest(self, candidates: list[LowPoly]) -> LowPoly:
        """Mesh whose normal map would leave the least angle, else that of the fewest faces."""
        reached = [low for low in candidates if low.report.is_close_to_count]
        if len(reached) < 2:
            return min(reached or candidates, key=lambda low: low.mesh.n_faces)
        candidates = reached
        options, lows = RenderOptions(width=_PICTURE, height=_PICTURE), [c.mesh for c in candidates]
        found = compare_shapes(self.high, lows, options, threads=self.threads)
        angles = [(1.0 - other) * _WITH_MAP * mean + other * _OTHER_PART for mean, other in found]
        return candidates[angles.index(min(angles))]
