"""Every command, over every mesh of the catalog, after every change."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from catalog.case import Case
from catalog.geometry import GEOMETRY
from catalog.texture_space import TEXTURE_SPACE
from invariance import mesh_commands, texture_commands
from invariance.changes import (
    CORNERS,
    FACES,
    MIRROR,
    PLACE,
    QUARTER,
    SCALE,
    SHIFT,
    TURN,
    Change,
)
from invariance.mesh_commands import Command
from invariance.quantities import Outcome, Refusal, compared, outcome, sides

from texbake import Mesh

MESHES = GEOMETRY + TEXTURE_SPACE
COMMANDS: dict[str, Command] = {
    **mesh_commands.PLAIN,
    **texture_commands.PLAIN,
    **mesh_commands.TEXTURED,
    **texture_commands.TEXTURED,
}
# They are given texture coordinates where they have none.
TEXTURED = {*mesh_commands.TEXTURED, *texture_commands.TEXTURED}
TURNS = (QUARTER, MIRROR, TURN)


@dataclass(frozen=True, kw_only=True)
class Undecided:
    """Where a result depends on the change, by its nature.

    `commands` are the beginnings of their names.
    """

    commands: tuple[str, ...]
    kinds: tuple[str, ...]
    meshes: frozenset[str]
    reason: str


UNDECIDED = (
    Undecided(
        commands=("",),
        kinds=(FACES,),
        meshes=frozenset({
            "duplicate faces", "duplicate faces turned", "coincident shells",
            "sheets that cross along edges", "coordinates three deep",
            "mirrored halves sharing vertices", "opposing neighbors", "face over the ±π seam",
            "face that holds a pole",
        }),
        reason="of faces that lie on one another, in space or in the texture, the first counts",
    ),
    Undecided(
        commands=("",),
        kinds=(FACES,),
        meshes=frozenset({"edge of five faces", "bow-tie vertex", "Möbius strip"}),
        reason="the normals around a vertex cancel, and that of its first face is taken",
    ),
    Undecided(
        commands=("tangents",),
        kinds=TURNS,
        meshes=frozenset({
            "zero-area faces", "duplicate faces turned", "bow-tie vertex", "all in one point",
            "one index thrice", "zero-area coordinates", "coordinates of area down to 1e-24",
            "coordinates of 1e9", "coordinates on a line", "u constant", "all coordinates equal",
        }),
        reason="no rule gives a tangent, which is then an axis of the space",
    ),
    Undecided(
        commands=("bake",),
        kinds=(QUARTER,),
        meshes=frozenset({"bow-tie vertex"}),
        reason="no rule gives a tangent at its vertex, and so none a normal in tangent space",
    ),
    Undecided(
        commands=("bake of closest points",),
        kinds=(FACES,),
        meshes=frozenset({"sizes 1 to 1e-9 in one"}),
        reason="from its smallest cube, several faces are equally close, and the first counts",
    ),
    Undecided(
        commands=("cage",),
        kinds=(TURN,),
        meshes=frozenset({
            "needles", "caps", "duplicate faces turned", "edge of five faces",
            "strip of 1 by 1e6",
        }),
        reason="normals that cancel, and those of the thinnest faces, are rounding",
    ),
    Undecided(
        commands=("bake-texture of a photograph",),
        kinds=(SHIFT, CORNERS, *TURNS),
        meshes=frozenset({"duplicate faces turned", "sizes 1 to 1e-9 in one"}),
        reason="what touches a face closer than 2^-16 of the size may hide it",
    ),
    Undecided(
        commands=("bake-texture of a photograph",),
        kinds=TURNS,
        meshes=frozenset({"duplicate faces", "wall thinner than the cage", "negative zeros"}),
        reason="the camera lies in the plane of a face, and sees it or not by rounding",
    ),
    Undecided(
        commands=("orientation",),
        kinds=TURNS,
        meshes=frozenset({"coordinates three deep"}),
        reason="the middle of three sheets is seen from one side as little as from the other",
    ),
    Undecided(
        commands=("convert to stl", "convert to glb"),
        kinds=(SHIFT, PLACE, TURN),
        meshes=frozenset({"needles", "offset 1e7 sizes"}),
        reason="float32 merges their vertices at some places, which is refused",
    ),
    Undecided(
        commands=("cage", "bake-texture", "normals", "transform"),
        kinds=(SCALE, TURN),
        meshes=frozenset({"subnormal coordinates"}),
        reason="float64 holds few bits of it, and no power of two that makes it of unit size",
    ),
    Undecided(
        commands=("unwrap by xatlas",),
        kinds=(TURN,),
        meshes=frozenset({"caps", "strip of 1 by 1e6"}),
        reason="xatlas computes in float32, in which the normals of its faces are rounding",
    ),
    Undecided(
        commands=("unwrap keep",),
        kinds=(TURN,),
        meshes=frozenset({"points on one line"}),
        reason="whether rounding leaves it an area decides which of two refusals it gets",
    ),
    Undecided(
        commands=("bake", "remap", "cage"),
        kinds=(SCALE,),
        meshes=frozenset({"all in one point"}),
        reason="it has no size that lengths could be relative to",
    ),
    Undecided(
        commands=("cage",),
        kinds=(FACES,),
        meshes=frozenset({"sizes 1 to 1e-9 in one"}),
        reason="the cage of a cube 1e-9 large reaches for points a billion times as far away",
    ),
)  # fmt: skip


def reason_of(command: str, kind: str, mesh: str) -> str | None:
    """Why a result may depend on a change, or None."""
    for item in UNDECIDED:
        if kind in item.kinds and mesh in item.meshes and command.startswith(item.commands):
            return item.reason
    return None


def faults_of(
    command: str,
    pairs: Iterator[tuple[Case[Mesh], Change]],
    in_cells: Callable[[Case[Mesh]], Mesh],
) -> Iterator[str]:
    """Run a command on meshes before and after changes; say where it differs too much."""
    known: dict[tuple[str, bool], Outcome] = {}
    for case, change in pairs:
        if reason_of(command, change.kind, case.name) is not None:
            continue
        mesh = in_cells(case) if command in TEXTURED else case.make()
        changed = change.applied(mesh)
        one, two = sides(changed)
        key = case.name, change.kind == PLACE
        if key not in known:
            known[key] = outcome(COMMANDS[command], one)
        before, after = known[key], outcome(COMMANDS[command], two)
        where = f"{case.name}, {change.kind} {change.name}"
        if isinstance(before, Refusal) or isinstance(after, Refusal):
            if before != after:
                yield f"{where}: refused by one: {_shown(before)} | {_shown(after)}"
            continue
        for item in compared(before, after, changed):
            if not item.holds:
                yield (
                    f"{where}: {item.name} differs by {item.difference:.3g}, "
                    f"and may by {item.bound:.3g}"
                )


def _shown(found: Outcome) -> str:
    return found.message if isinstance(found, Refusal) else "a result"
