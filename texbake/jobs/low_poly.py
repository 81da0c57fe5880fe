"""The low-poly mesh of `run` and `lighten`: simplified as it is, or wrapped before.

Where both are possible, pictures decide which comes closer to the high-poly mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from texbake.errors import MeshError
from texbake.mesh.hard_edges import LowNormals
from texbake.mesh.mesh import Mesh
from texbake.mesh.simplify import SimplifyReport, check_count, simplify_with_report
from texbake.mesh.wrapping import reason_to_wrap, wrapped
from texbake.progress import ProgressSink
from texbake.rendering.compare import Closeness, compare
from texbake.rendering.options import RenderOptions

# Side of the pictures that decide, from six sides. A pixel that shows another part counts as much
# as one whose normals differ by this, in degrees.
_PICTURE, _OTHER_PART = 256, 90.0
# How far rays go for a wrap whose tunnels were closed, as a share of the diagonal. Measured
# distances reach into the deepest pore there: they take ten times as long, and gain nothing.
_RAYS = 0.02


@dataclass(frozen=True, kw_only=True)
class LowPoly:
    """A low-poly mesh, and how it was made.

    Attributes
    ----------
    mesh : Mesh
    report : SimplifyReport
    why : tuple of str
        Why it was made from a closed surface around the high-poly mesh, if no option asked for it.
    ray_distance : float, optional
        How far rays of the bake go, outside and inside; None where that is measured.
    """

    mesh: Mesh
    report: SimplifyReport
    why: tuple[str, ...] = ()
    ray_distance: float | None = None


@dataclass(frozen=True, kw_only=True)
class _Maker:
    """Makes low-poly meshes of one high-poly mesh."""

    high: Mesh
    rule: LowNormals
    n_faces: int | None
    error: str | float | None
    quality: str
    seams: str
    threads: int | None
    progress: ProgressSink | None

    def simplified(self, mesh: Mesh, quality: str) -> LowPoly:
        low, report = simplify_with_report(
            self.rule.to_simplify(mesh, self.high, threads=self.threads),
            self.n_faces,
            error=self.error,
            quality=quality,
            seams=self.seams,
            threads=self.threads,
            progress=self.progress,
        )
        return LowPoly(mesh=low, report=report)

    def kept(self) -> LowPoly:
        return self.simplified(self.high, self.quality)

    def wrapped(self, reason: str, *, has_tunnels: bool = False) -> LowPoly:
        wrap, width = wrapped(
            self.high,
            self.n_faces,
            has_tunnels=has_tunnels,
            threads=self.threads,
            progress=self.progress,
        )
        # The vertices of a wrap are none of the mesh: nothing is lost if they move.
        low = self.simplified(wrap, "best" if width else self.quality)
        if not reason:
            why: tuple[str, ...] = ()
        else:
            why = (
                f"{self.high.name}: {reason}; the low-poly mesh was made from a closed surface "
                "around it; `remesh` never leaves it as it is",
            )
        if width:
            share = 100.0 * width / self.high.diagonal
            why = (
                *why,
                f"{self.high.name}: gaps up to {share:.0f} % of its diagonal were closed, so that "
                f"{self.n_faces:,} triangles can show the tunnels that are left",
            )
        distance = _RAYS * self.high.diagonal if width else None
        return replace(low, why=why, ray_distance=distance)

    def off_by(self, low: LowPoly) -> float:
        """Mean angle between the normals in pictures of the high-poly mesh and a low-poly one."""
        options = RenderOptions(width=_PICTURE, height=_PICTURE)
        found = compare(
            self.high, low.mesh.replace(uvs=None, uv_faces=None), options=options,
            threads=self.threads,
        ).bare  # fmt: skip
        return _mean_with_mismatches(found)


def _mean_with_mismatches(found: Closeness) -> float:
    mismatch = found.outline_mismatch + found.depth_mismatch
    mean = found.mean_deg if found.n_pixels else 0.0
    return (1.0 - mismatch) * mean + mismatch * _OTHER_PART


def make_low_poly(
    high: Mesh,
    n_faces: int | None,
    *,
    error: str | float | None = None,
    quality: str,
    seams: str = "auto",
    remesh: str,
    rule: LowNormals,
    threads: int | None = None,
    progress: ProgressSink | None = None,
) -> LowPoly:
    """Reduce a mesh to a number of faces, from a closed surface around it if that is closer.

    Parameters
    ----------
    high
    n_faces, error, quality, seams, threads, progress
        As for `simplify_with_report`.
    remesh : {"auto", "always", "never"}
    rule
        Which edges are hard.

    Raises
    ------
    MeshError
        More faces than requested are left, by over 1 %.
    """
    make = _Maker(
        high=high, rule=rule, n_faces=n_faces, error=error, quality=quality, seams=seams,
        threads=threads, progress=progress,
    )  # fmt: skip
    if remesh == "always":
        low = make.wrapped("")
    else:
        low = _closest(make) if remesh == "auto" else make.kept()
    if error is None:
        more = "ask for more" if remesh == "always" else "ask for more, or use `remesh` always"
        check_count(low.report, high.name, more)
    return low


def _closest(make: _Maker) -> LowPoly:
    high, n_faces = make.high, make.n_faces
    reason = None
    if n_faces is None or high.n_faces > n_faces:
        reason = reason_to_wrap(high, n_faces, threads=make.threads)
    if reason is None:
        return make.kept()
    try:
        wrap = make.wrapped(reason.text, has_tunnels=reason.has_tunnels)
    except MeshError:
        return make.kept()
    if n_faces is None or (reason.is_certain and wrap.report.is_whole):
        return wrap
    kept = make.kept()
    candidates = [low for low in (wrap, kept) if low.report.is_whole]
    if len(candidates) == 2:
        return min(candidates, key=make.off_by)
    return candidates[0] if candidates else min(wrap, kept, key=lambda low: low.mesh.n_faces)
