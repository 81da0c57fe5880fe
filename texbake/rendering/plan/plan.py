"""A scene compiled into passes, each with the reasons that called for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from texbake.rendering.plan.effect import (
    Call,
    Effect,
    Refusal,
    Target,
)
from texbake.rendering.plan.question import Question


@dataclass(frozen=True)
class Pass:
    """An effect with what called for it; `calls` has at least one for each of its targets."""

    effect: Effect
    calls: tuple[Call, ...]

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def targets(self) -> tuple[Target, ...]:
        """What it is computed for, each once, in the order of the scene."""
        return tuple(
            sorted({call.target for call in self.calls}, key=lambda t: -1 if t is None else t)
        )


@dataclass(frozen=True)
class LeftOut:
    """An effect, or one target of it, that is not in the plan."""

    name: str
    by: str
    why: str


@dataclass(frozen=True)
class Plan:
    """What will be computed, in order, and what will not."""

    passes: tuple[Pass, ...]
    left_out: tuple[LeftOut, ...]

    def has(self, name: str, target: Target = None) -> bool:
        """Whether an effect is called for: for this target, or at all where that is None."""
        return any(
            item.name == name and (target is None or target in item.targets) for item in self.passes
        )

    def for_target(self, target: Target) -> tuple[Effect, ...]:
        """Effects called for by an object, in order."""
        return tuple(
            item.effect
            for item in self.passes
            if item.effect.of == "object" and target in item.targets
        )


def compile_plan(question: Question, effects: Sequence[Effect]) -> Plan:
    """List the passes that a picture needs.

    Parameters
    ----------
    question
        The scene and how it is looked at.
    effects
        All that there are, each after those it needs.

    Raises
    ------
    AssertionError
        An effect needs one that stands after it, or that does not exist: a defect of the list.
    """
    by_name = {effect.name: effect for effect in effects}
    places = {effect.name: place for place, effect in enumerate(effects)}
    calls: dict[str, list[Call]] = {effect.name: [] for effect in effects}
    refusals: dict[str, list[Refusal]] = {effect.name: [] for effect in effects}

    def add(effect: Effect, call: Call) -> None:
        known = call in calls[effect.name]
        is_new = all(call.target != other.target for other in calls[effect.name])
        if not known:
            calls[effect.name].append(call)
        if not is_new or effect.needs is None:
            return
        for name in effect.needs(question, call.target):
            needed = by_name[name]
            assert places[name] < places[effect.name], f"{effect.name} stands before {name}"
            target = call.target if needed.of == effect.of else None
            assert target is not None or needed.of == "picture", f"{effect.name} needs {name}"
            add(needed, Call(target, call.by, f"for {effect.name}"))

    for effect in effects:
        for answer in effect.called_for(question):
            if isinstance(answer, Call):
                add(effect, answer)
            else:
                refusals[effect.name].append(answer)
    return Plan(
        tuple(Pass(effect, tuple(calls[effect.name])) for effect in effects if calls[effect.name]),
        tuple(_left_out(effects, calls, refusals)),
    )


def _left_out(
    effects: Sequence[Effect], calls: dict[str, list[Call]], refusals: dict[str, list[Refusal]]
) -> list[LeftOut]:
    left_out = []
    for effect in effects:
        left_out += [
            LeftOut(effect.name, refusal.by, refusal.why) for refusal in refusals[effect.name]
        ]
        if not calls[effect.name] and not refusals[effect.name]:
            left_out.append(LeftOut(effect.name, "", effect.left_out))
    return left_out
