"""The assets of a pipeline and their steps: patterns become files, references become inputs."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from graphlib import CycleError, TopologicalSorter
from pathlib import PurePosixPath

from texbake.building.file import AssetRule, Pipeline, StepTable
from texbake.building.locations import is_url, matches
from texbake.errors import OptionError, quoted
from texbake.files import is_file
from texbake.records import dataclass
from texbake.rendering.scene.file.values import nearest

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
            known = nearest(pattern, assets)
            near = known if len(known) < 200 else f"there are {len(assets):,}"
            raise OptionError(f"only: no asset is called {quoted(pattern)}; {near}")
    return [asset for name, asset in assets.items() if any(_is(name, pattern) for pattern in only)]


def _is(name: str, pattern: str) -> bool:
    """Whether a pattern is a name, which may have brackets, or matches it."""
    return name == pattern or fnmatchcase(name, pattern)


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
    name = fill_in(pipeline, place, rule.name or "{stem}", values)
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


Id = tuple[str, str]

# Names in the folder of outputs that are reserved for the build itself.
BUILDS_OWN = {"build.json", ".texbake"}


@dataclass(frozen=True)
class FileSource:
    """An input that is a file: a path, or a URL."""

    path: str


@dataclass(frozen=True)
class StepSource:
    """An input that another step makes."""

    node: Id
    output: str


Source = FileSource | StepSource


@dataclass(frozen=True, eq=False)
class Node:
    """One step of one asset."""

    id: Id  # names of the asset and the step
    table: StepTable
    inputs: dict[str, tuple[Source, ...]]  # by role
    waits_for: tuple[Id, ...]  # steps that must end first
    outputs: dict[str, str]  # file name of each output
    published: dict[str, str]  # name of each published output below the folder of outputs

    @property
    def files(self) -> list[str]:
        """Paths and URLs of the inputs that are files."""
        sources = [source for found in self.inputs.values() for source in found]
        return [source.path for source in sources if isinstance(source, FileSource)]


def plan_nodes(
    pipeline: Pipeline, assets: Sequence[PipelineAsset], outputs: str | None = None
) -> dict[Id, Node]:
    """Return all steps of all assets, each after those that it depends on."""
    nodes: dict[Id, Node] = {}
    for asset in assets:
        found = _steps_of(pipeline, asset)
        nodes.update((found[name].id, found[name]) for name in _ordered(pipeline, found))
    place = outputs or absolute(pipeline, pipeline.outputs or str(pipeline.folder))
    _check_outputs(pipeline, nodes.values(), assets, place)
    return nodes


def _steps_of(pipeline: Pipeline, asset: PipelineAsset) -> dict[str, Node]:
    """Return the steps of an asset's rule, and all steps that they need."""
    wanted = list(pipeline.steps if asset.rule.steps is None else asset.rule.steps)
    found: dict[str, Node] = {}
    while wanted:
        name = wanted.pop()
        if name not in found:
            found[name] = _node(pipeline, asset, pipeline.step(name, asset.rule))
            wanted += [step for _, step in found[name].waits_for]
    return found


def _node(pipeline: Pipeline, asset: PipelineAsset, table: StepTable) -> Node:
    inputs = {
        role: tuple(_source(pipeline, asset, table, role, text) for text in texts)
        for role, texts in table.inputs.items()
    }
    before = [s.node for sources in inputs.values() for s in sources if isinstance(s, StepSource)]
    for name in table.after:
        if name not in pipeline.steps:
            raise table.fault("after", f"no step {quoted(name)}; {nearest(name, pipeline.steps)}")
        before.append((asset.name, name))
    outputs = table.kind.outputs(table.settings)
    return Node(
        id=(asset.name, table.name),
        table=table,
        inputs=inputs,
        waits_for=tuple(dict.fromkeys(before)),
        outputs=outputs,
        published=_name_outputs(asset, table, outputs),
    )


def _source(
    pipeline: Pipeline, asset: PipelineAsset, table: StepTable, role: str, text: str
) -> Source:
    """Resolve a reference: a step, one of its outputs, an input of the asset, or a file."""
    name, _, output = text.partition(".")
    if name in pipeline.steps:
        maker = pipeline.step(name, asset.rule)
        outputs = maker.kind.outputs(maker.settings)
        if output and output not in outputs:
            raise table.fault(role, f"{name} makes no {quoted(output)}; {nearest(output, outputs)}")
        return StepSource((asset.name, name), output or next(iter(outputs)))
    if text in asset.inputs:
        return FileSource(asset.inputs[text])
    if "." not in text and "/" not in text:
        near = nearest(text, [*pipeline.steps, *asset.inputs])
        raise table.fault(
            role, f"{quoted(text)} is neither a step nor an input of {asset.name}; {near}"
        )
    filled = fill_in(pipeline, ("steps", table.name, role), text, {"asset": asset.name})
    path = absolute(pipeline, filled)
    if not is_url(path) and "{" not in text and not is_file(path):
        raise table.fault(
            role, f"{quoted(text)} is neither a step nor an input nor a file there is"
        )
    return FileSource(path)


def _name_outputs(
    asset: PipelineAsset, table: StepTable, outputs: dict[str, str]
) -> dict[str, str]:
    """Return the name of each output below the folder of outputs."""
    if table.output is None:
        return {}
    names = {}
    for output, file in outputs.items():
        values = {
            "asset": asset.name,
            "step": table.name,
            "output": output,
            "ext": PurePosixPath(file).suffix.removeprefix("."),
        }
        place = ("steps", table.name, "output")
        name = fill_in(table.pipeline, place, table.output, values)
        name = name.removesuffix(".")  # a folder has no suffix
        if (fault := _fault_of(name, PurePosixPath(file).suffix)) is not None:
            raise table.fault("output", fault)
        names[output] = name
    return names


def _fault_of(name: str, suffix: str) -> str | None:
    """Return what is wrong with the name of an output that has this suffix."""
    if name.startswith("/") or "\\" in name or {"", ".", ".."} & set(name.split("/")):
        return f"{quoted(name)} does not lie below the folder of outputs"
    if any(character < " " for character in name):
        return f"{quoted(name)} has a character that file names cannot have"
    if suffix and PurePosixPath(name).suffix.lower() != suffix:
        return f"{quoted(name)} has the wrong suffix for a {suffix} file; end it with .{{ext}}"
    return None


def _ordered(pipeline: Pipeline, found: dict[str, Node]) -> list[str]:
    before = {name: {step for _, step in node.waits_for} for name, node in found.items()}
    try:
        return list(TopologicalSorter(before).static_order())
    except CycleError as error:
        circle: list[str] = error.args[1]
        chain = " needs ".join(reversed(circle))
        raise pipeline.fault(
            ("steps", circle[-1]), f"the steps wait for one another: {chain}"
        ) from error


def _check_outputs(
    pipeline: Pipeline, nodes: Collection[Node], assets: Sequence[PipelineAsset], outputs: str
) -> None:
    """Raise where two outputs have one name, one lies in another, or would overwrite an input."""
    owners: dict[str, Node] = {}
    for node in nodes:
        names = list(node.published.values())
        for name in names:
            other = owners.setdefault(name, node)
            if other is not node:
                raise node.table.fault(
                    "output",
                    f"{' '.join(other.id)} and {' '.join(node.id)} both write {quoted(name)}; "
                    "put {asset} or {step} into the pattern",
                )
            if names.count(name) > 1:
                raise node.table.fault(
                    "output",
                    f"several outputs are called {quoted(name)}; put {{output}} into the pattern",
                )
    for name, node in owners.items():
        for folder in PurePosixPath(name).parents:
            if (inside := owners.get(str(folder))) is not None:
                raise node.table.fault(
                    "output",
                    f"{name} would lie in {folder}, which {' '.join(inside.id)} makes as well",
                )
    if not is_url(outputs):
        read = {path for asset in assets for path in asset.inputs.values()}
        read.update(path for node in nodes for path in node.files)
        _check_files(pipeline, owners, read, os.path.realpath(outputs))


def _check_files(pipeline: Pipeline, owners: dict[str, Node], read: set[str], root: str) -> None:
    """Raise where an output would overwrite an input, the pipeline file or a build's own."""
    taken = {os.path.realpath(path): "is also an input" for path in read if not is_url(path)}
    taken[os.path.realpath(pipeline.path)] = "is this file itself"
    for path, what in taken.items():
        name = path.removeprefix(root + os.sep).replace(os.sep, "/")
        if name in owners:
            raise owners[name].table.fault("output", f"{path} {what}")
    for name, node in owners.items():
        if name.split("/")[0] in BUILDS_OWN:
            raise node.table.fault(
                "output", f"{quoted(name)} is reserved for the build's own files"
            )
