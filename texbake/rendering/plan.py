"""The plan of a picture: which effects a scene needs and why.

`compile_plan` collects the effects that the scene calls for and adds the effects that these need in
turn. `plan_table` and `plan_report` show the passes with their reasons and, after rendering, their
costs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from texbake.records import dataclass
from texbake.rendering.effect import Activation, Effect, Pass, Plan, Rejection
from texbake.rendering.request import RenderRequest
from texbake.rendering.results import Costs, PassCost, Target
from texbake.rendering.scene_simplification import SkippedEffect

# Passes that every picture has, in the order in which they run.
EVERY_PICTURE = {
    "rasterizing": "finds the nearest triangle at each sample",
    "fragments": "makes one fragment for each triangle in a pixel",
    "pixels": "averages fragments",
}
# Maximum number of reasons in a row of the table.
_MOST_REASONS = 2


def compile_plan(request: RenderRequest, effects: Sequence[Effect]) -> Plan:
    """List the passes that a picture needs."""
    by_name = {effect.name: effect for effect in effects}
    places = {effect.name: place for place, effect in enumerate(effects)}
    # The values are not used: dictionaries keep the order, and each activation once.
    active: dict[str, dict[Activation, None]] = {effect.name: {} for effect in effects}
    rejections: dict[str, list[Rejection]] = {effect.name: [] for effect in effects}
    known: set[tuple[str, Target, int | None]] = set()

    def add(effect: Effect, activation: Activation) -> None:
        active[effect.name][activation] = None
        key = effect.name, activation.target, activation.source
        if key in known:
            return
        known.add(key)
        for name in effect.needed(request, activation.target):
            needed = by_name[name]
            assert places[name] < places[effect.name], f"{effect.name} comes before {name}"
            target = activation.target if needed.of == effect.of else None
            assert target is not None or needed.of == "picture", f"{effect.name} needs {name}"
            source = activation.target if effect.of == "object" else activation.source
            source = None if needed.of == "object" else source
            add(needed, Activation(target, activation.requested_by, f"for {effect.name}", source))

    for effect in effects:
        for answer in effect.activated_by(request):
            if isinstance(answer, Activation):
                add(effect, answer)
            else:
                rejections[effect.name].append(answer)
    passes = [Pass(each, tuple(active[each.name])) for each in effects if active[each.name]]
    skipped = list(request.removed)
    shown = {item.name for item in request.removed}
    removed = {(item.name, item.requested_by) for item in request.removed}
    for effect in effects:
        skipped += [
            SkippedEffect(effect.name, item.requested_by, item.why)
            for item in rejections[effect.name]
            if (effect.name, item.requested_by) not in removed
        ]
        if not (active[effect.name] or rejections[effect.name] or effect.name in shown):
            skipped.append(SkippedEffect(effect.name, "", effect.left_out))
    return Plan(tuple(passes), tuple(skipped))


@dataclass(frozen=True)
class PlanRow:
    """A pass in the table; its cost, summed over all threads, is None before it has run."""

    name: str
    does: str
    reasons: tuple[str, ...]
    milliseconds: float | None
    n_bytes: int | None
    skipped: str


def plan_rows(plan: Plan, costs: Costs | None = None) -> list[PlanRow]:
    """Return the passes of a plan in order, with their costs if they have run."""

    def row(name: str, does: str, reasons: Iterable[str]) -> PlanRow:
        if costs is None:
            return PlanRow(name, does, tuple(reasons), None, None, "")
        cost = costs.by_name.get(name, PassCost())
        skipped = "" if cost.has_run else cost.skipped
        return PlanRow(name, does, tuple(reasons), 1e3 * cost.seconds, cost.n_bytes, skipped)

    every = [row(name, does, ["every picture"]) for name, does in EVERY_PICTURE.items()]
    moving, others = (
        [
            row(item.name, item.effect.does, _reasons(item.activations))
            for item in plan.passes
            if item.effect.moves_surface == moves
        ]
        for moves in (True, False)
    )
    return [*moving, *every[:2], *others, every[2]]


def _reasons(activations: Iterable[Activation]) -> list[str]:
    """Return the distinct reasons for a pass, each with everything it applies to."""
    requested_by: dict[str, list[str]] = {}
    for item in activations:
        requested_by.setdefault(item.why, []).append(item.requested_by)
    found = []
    for why, repeated in requested_by.items():
        names = list(dict.fromkeys(repeated))
        few = len(names) <= _MOST_REASONS
        some = ", ".join(names) if few else f"{names[0]} and {len(names) - 1} others"
        found.append(f"{why} ({some})")
    return found


def plan_table(
    plan: Plan, costs: Costs | None = None
) -> tuple[list[tuple[str, ...]], list[tuple[str, str]]]:
    """Return the table of passes with a header row, and the effects left out with reasons."""
    head: tuple[str, ...] = ("pass", "called for by")
    if costs is not None:
        head = (*head, "ms", "kB")
    rows: list[tuple[str, ...]] = [head]
    for row in plan_rows(plan, costs):
        reasons = "; ".join(row.reasons[:_MOST_REASONS])
        if len(row.reasons) > _MOST_REASONS:
            reasons += "; ..."
        cells = (row.name, (row.skipped and f"not run: {row.skipped}") or reasons)
        if row.milliseconds is not None and row.n_bytes is not None:
            cells = (*cells, f"{row.milliseconds:,.1f}", f"{row.n_bytes / 1000:,.0f}")  # type: ignore[assignment]
        rows.append(cells)
    left_out = [
        (item.name, f"{item.requested_by}: {item.why}" if item.requested_by else item.why)
        for item in plan.left_out
    ]
    return rows, left_out


def plan_report(plan: Plan, costs: Costs | None = None) -> dict[str, Any]:
    """Return the plan as JSON values.

    `passes` is a list of {name, does, called_for_by: [{target, by, why}], milliseconds, bytes,
    skipped}, the last three only after rendering. `left_out` is a list of {name, by, why}.
    """
    reasons = {
        item.name: [
            {"target": each.target, "by": each.requested_by, "why": each.why}
            for each in item.activations
        ]
        for item in plan.passes
    }
    passes = []
    for row in plan_rows(plan, costs):
        entry: dict[str, Any] = {
            "name": row.name,
            "does": row.does,
            "called_for_by": reasons.get(
                row.name, [{"target": None, "by": "every picture", "why": "it is drawn"}]
            ),
        }
        if row.milliseconds is not None:
            entry |= {
                "milliseconds": row.milliseconds,
                "bytes": row.n_bytes,
                "skipped": row.skipped or None,
            }
        passes.append(entry)
    left_out = [
        {"name": item.name, "by": item.requested_by or None, "why": item.why}
        for item in plan.left_out
    ]
    return {"passes": passes, "left_out": left_out}
