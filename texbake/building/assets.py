"""The assets of a pipeline: names and files from tables with patterns and names in braces."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from texbake.building.file import AssetRule, Pipeline
from texbake.building.locations import is_url, matches
from texbake.errors import OptionError, quoted
from texbake.rendering.scene.file.values import nearest

DEFAULT_NAME = "{stem}"
_PLACE = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True)
class PipelineAsset:
    """One asset."""

    name: str
    rule: AssetRule  # the table that defines it
    inputs: dict[str, str]  # path or URL of each input


def find_assets(pipeline: Pipeline, only: Sequence[str] = ()) -> list[PipelineAsset]:
    """Return all assets, or those whose names match, in the order of the file and then by path."""
    assets: dict[str, PipelineAsset] = {}
    for rule in pipeline.rules:
        for asset in _of_rule(pipeline, rule):
            if asset.name in assets:
                raise _twice(pipeline, assets[asset.name], asset)
            assets[asset.name] = asset
    if not only:
        return list(assets.values())
    for pattern in only:
        if not any(_is(name, pattern) for name in assets):
            raise OptionError(
                f"only: no asset is called {quoted(pattern)}; {_near(pattern, assets)}"
            )
    return [asset for name, asset in assets.items() if any(_is(name, pattern) for pattern in only)]


def _is(name: str, pattern: str) -> bool:
    """Whether a pattern is a name, which may have brackets, or matches it."""
    return name == pattern or fnmatchcase(name, pattern)


def _near(pattern: str, names: dict[str, PipelineAsset]) -> str:
    known = nearest(pattern, names)
    return known if len(known) < 200 else f"there are {len(names):,}"


def _of_rule(pipeline: Pipeline, rule: AssetRule) -> list[PipelineAsset]:
    place = ("assets", rule.index)
    if not rule.inputs:
        return [_asset(pipeline, rule, {}, {"name": rule.name or ""})]
    first, *others = rule.inputs
    found: dict[str, None] = {}
    for pattern in rule.inputs[first]:
        hits = matches(pattern, pipeline.path.parent)
        if not hits:
            raise pipeline.fault(
                (*place, "inputs", first),
                f"{quoted(pattern)} matches no file; it is relative to {pipeline.path.parent}",
            )
        found.update(dict.fromkeys(hits))
    assets = []
    for path in found:
        values = _values(path)
        inputs = {first: path}
        for name in others:
            if len(rule.inputs[name]) != 1:
                raise pipeline.fault((*place, "inputs", name), "only the first may be a list")
            where = (*place, "inputs", name)
            inputs[name] = absolute(
                pipeline, fill_in(pipeline, where, rule.inputs[name][0], values)
            )
        assets.append(_asset(pipeline, rule, inputs, values))
    return assets


def _values(path: str) -> dict[str, str]:
    """Return the values of names in braces for an asset with this first input."""
    folder, file = path.rsplit("/", 1) if is_url(path) else os.path.split(path)
    stem = os.path.splitext(file)[0]  # noqa: PTH122
    return {"stem": stem, "folder": os.path.basename(folder)}  # noqa: PTH119


def absolute(pipeline: Pipeline, path: str) -> str:
    """Return the path of a name that is relative to the pipeline file; URLs are unchanged."""
    return path if is_url(path) else str(pipeline.path.parent / path)


def _asset(
    pipeline: Pipeline, rule: AssetRule, inputs: dict[str, str], values: dict[str, str]
) -> PipelineAsset:
    place = ("assets", rule.index, "name")
    name = fill_in(pipeline, place, rule.name or DEFAULT_NAME, values)
    parts = name.split("/")
    if not name or name.startswith("/") or "\\" in name or {"", ".", ".."} & set(parts):
        raise pipeline.fault(
            place, f"{quoted(name)} is not a name for files; use one without .. and \\"
        )
    return PipelineAsset(name, rule, inputs)


def _twice(pipeline: Pipeline, one: PipelineAsset, other: PipelineAsset) -> Exception:
    rule = other.rule
    key = ("name",) if rule.name else ("inputs", *list(rule.inputs)[:1])
    place: tuple[int | str, ...] = ("assets", rule.index, *key)
    sources = [next(iter(asset.inputs.values()), "") for asset in (one, other)]
    if all(sources):
        return pipeline.fault(
            place,
            f"{sources[0]} and {sources[1]} both give the asset {quoted(one.name)}; "
            "use a name that distinguishes them, such as '{folder}_{stem}'",
        )
    return pipeline.fault(
        place, f"two assets are called {quoted(one.name)}; give each its own name"
    )


def fill_in(
    pipeline: Pipeline, place: tuple[int | str, ...], pattern: str, values: Mapping[str, str]
) -> str:
    """Fill in the names in braces of a pattern at a place of the file."""
    if {"{", "}"} & set(_PLACE.sub("", pattern)):
        what = f"{quoted(pattern)} has an unmatched brace; names are written {{name}}"
        raise pipeline.fault(place, what)

    def value(found: re.Match[str]) -> str:
        if found[1] not in values:
            what = f"{quoted(pattern)} has {found[0]}, which is not known"
            raise pipeline.fault(place, f"{what}; {nearest(found[1], values)}")
        return values[found[1]]

    return _PLACE.sub(value, pattern)
