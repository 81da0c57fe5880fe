"""The steps of each asset and their dependencies: references become files and other steps."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import PurePosixPath

from texbake.building.assets import PipelineAsset, absolute, fill_in
from texbake.building.file import Pipeline, StepTable
from texbake.building.locations import is_url
from texbake.errors import quoted
from texbake.files import is_file
from texbake.rendering.scene.file.values import nearest

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


def plan_nodes(
    pipeline: Pipeline, assets: Sequence[PipelineAsset], outputs: str | None = None
) -> dict[Id, Node]:
    """Return all steps of all assets, each after those that it depends on."""
    nodes: dict[Id, Node] = {}
    orders: dict[tuple[str, ...], list[str]] = {}
    for asset in assets:
        found = _steps_of(pipeline, asset)
        shape = (*sorted(found), str(asset.rule.index))
        if shape not in orders:
            orders[shape] = _ordered(pipeline, found)
        nodes.update((found[name].id, found[name]) for name in orders[shape])
    _check_outputs(pipeline, nodes.values(), assets, outputs or _outputs(pipeline))
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
            raise pipeline.fault(
                (*table.place, "after"), f"no step {quoted(name)}; {nearest(name, pipeline.steps)}"
            )
        before.append((asset.name, name))
    outputs = table.kind.outputs(table.settings)
    return Node(
        id=(asset.name, table.name),
        table=table,
        inputs=inputs,
        waits_for=tuple(dict.fromkeys(before)),
        outputs=outputs,
        published=_published(pipeline, asset, table, outputs),
    )


def _source(
    pipeline: Pipeline, asset: PipelineAsset, table: StepTable, role: str, text: str
) -> Source:
    """Resolve a reference: a step, one of its outputs, an input of the asset, or a file."""
    name, _, output = text.partition(".")
    if name in pipeline.steps:
        outputs = _outputs_of(pipeline, asset, name)
        if output and output not in outputs:
            raise pipeline.fault(
                (*table.place, role),
                f"{name} makes no {quoted(output)}; {nearest(output, outputs)}",
            )
        return StepSource((asset.name, name), output or next(iter(outputs)))
    if text in asset.inputs:
        return FileSource(asset.inputs[text])
    if "." not in text and "/" not in text:
        known = [*pipeline.steps, *asset.inputs]
        raise pipeline.fault(
            (*table.place, role),
            f"{quoted(text)} is neither a step nor an input of {asset.name}; "
            f"{nearest(text, known)}",
        )
    filled = fill_in(pipeline, (*table.place, role), text, {"asset": asset.name})
    path = absolute(pipeline, filled)
    if not is_url(path) and "{" not in text and not is_file(path):
        raise pipeline.fault(
            (*table.place, role),
            f"{quoted(text)} is neither a step nor an input nor a file there is",
        )
    return FileSource(path)


def _outputs_of(pipeline: Pipeline, asset: PipelineAsset, name: str) -> dict[str, str]:
    table = pipeline.step(name, asset.rule)
    return table.kind.outputs(table.settings)


def _published(
    pipeline: Pipeline, asset: PipelineAsset, table: StepTable, outputs: dict[str, str]
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
        name = fill_in(pipeline, (*table.place, "output"), table.output, values)
        name = name.removesuffix(".")  # a folder has no suffix
        if (fault := _fault_of(name, PurePosixPath(file).suffix)) is not None:
            raise pipeline.fault((*table.place, "output"), fault)
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


def _outputs(pipeline: Pipeline) -> str:
    """Return the folder or URL of the outputs."""
    return absolute(pipeline, pipeline.outputs or str(pipeline.folder))


def _check_outputs(
    pipeline: Pipeline, nodes: Collection[Node], assets: Sequence[PipelineAsset], outputs: str
) -> None:
    """Raise where two outputs have one name, one lies in another, or would overwrite an input."""
    owners: dict[str, Node] = {}
    for node in nodes:
        for name in node.published.values():
            other = owners.setdefault(name, node)
            if other is not node or list(node.published.values()).count(name) > 1:
                raise _same_output(pipeline, name, other, node)
    for name, node in owners.items():
        for folder in PurePosixPath(name).parents:
            if (inside := owners.get(str(folder))) is not None:
                raise pipeline.fault(
                    (*node.table.place, "output"),
                    f"{name} would lie in {folder}, which {' '.join(inside.id)} makes as well",
                )
    if not is_url(outputs):
        read = {path for asset in assets for path in asset.inputs.values()}
        read |= {path for node in nodes for path in _files_of(node)}
        _check_files(pipeline, owners, read, os.path.realpath(outputs))


def _files_of(node: Node) -> list[str]:
    sources = [source for found in node.inputs.values() for source in found]
    return [source.path for source in sources if isinstance(source, FileSource)]


def _check_files(pipeline: Pipeline, owners: dict[str, Node], read: set[str], root: str) -> None:
    """Raise where an output would overwrite an input, the pipeline file or a build's own."""
    taken = {os.path.realpath(path): "is also an input" for path in read if not is_url(path)}
    taken[os.path.realpath(pipeline.path)] = "is this file itself"
    for path, what in taken.items():
        name = path.removeprefix(root + os.sep).replace(os.sep, "/")
        if name in owners:
            raise pipeline.fault((*owners[name].table.place, "output"), f"{path} {what}")
    for name, node in owners.items():
        if name.split("/")[0] in BUILDS_OWN:
            raise pipeline.fault(
                (*node.table.place, "output"),
                f"{quoted(name)} is reserved for the build's own files",
            )


def _same_output(pipeline: Pipeline, name: str, one: Node, other: Node) -> Exception:
    place = (*other.table.place, "output")
    if one is other:
        return pipeline.fault(
            place, f"several outputs are called {quoted(name)}; put {{output}} into the pattern"
        )
    return pipeline.fault(
        place,
        f"{' '.join(one.id)} and {' '.join(other.id)} both write {quoted(name)}; "
        "put {asset} or {step} into the pattern",
    )
