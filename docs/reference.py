"""The pages of the reference that are made from the program itself.

    python docs/reference.py    # write docs/reference/{commands,pipeline,scenes,checks,python}.md

Commands, steps, keys, ranges and defaults are read from the schema of options, so that no page says
anything else than the program does. Of scenes.md only the tables are made; its text is written by
hand.
"""

from __future__ import annotations

import ast
import html
import re
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click
from texbake_cli.main import GROUPS, texbake as commands
from texbake_cli.signals import EXIT_CODES

import texbake as texbake_package
from texbake.building.file import pipeline_schema
from texbake.building.steps import STEP_KINDS
from texbake.checks.kinds import KINDS
from texbake.errors import OptionError
from texbake.rendering.scene.file.schema import TABLES, scene_schema

REFERENCE = Path(__file__).parent / "reference"
_DEFAULT = re.compile(r"\s+\[(?:default: )?([^\[\]]*)\]$")
_KINDS = {
    "integer": "whole number",
    "number": "number",
    "string": "text",
    "boolean": "`true`, `false`",
}
_PLURALS = {"integer": "whole numbers", "number": "numbers", "string": "texts", "object": "tables"}
_CHECKS = (
    "What `texbake check` finds; see [Check meshes before a bake](../how-to/check.md). Where this "
    "page has …, a finding has a figure or a name."
)
_MADE = "<!-- Made by docs/reference.py; change the program, not this page. -->"


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Write a table in Markdown."""
    heads = list(heads)
    lines = [heads, ["---"] * len(heads), *rows]
    cells = [[_without_bars(cell) for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def _without_bars(cell: str) -> str:
    """Write `|` as an entity: programs differ in how they read an escaped one in code."""

    def as_html(code: re.Match[str]) -> str:
        return f"<code>{html.escape(code[1], quote=False)}</code>"

    return re.sub(r"`([^`]*\|[^`]*)`", as_html, cell).replace("|", "&#124;")


def _page(parts: Iterable[str]) -> str:
    """Write a page; prose is wrapped, but not where a line would then start like a list item."""
    wrapped = []
    for part in parts:
        is_prose = not part.startswith(("#", "|", "```", "<!--", ":::"))
        lines = textwrap.wrap(part, 120, break_long_words=False, break_on_hyphens=False)
        safe = is_prose and not any(re.match(r"([-+*#>|]|\d+[.)])(\s|$)", line) for line in lines)
        wrapped.append("\n".join(lines) if safe else part)
    return "\n\n".join(wrapped) + "\n"


def commands_page() -> str:
    """Write every command with its options, as its help page has them."""
    parts = ["# Commands", _MADE]
    parts.append("`texbake COMMAND --help` prints the same; with many options, `--help-all` does.")
    parts.append(table(("group", "commands"), map(_links, GROUPS, GROUPS.values())))
    group = click.Context(commands, info_name="texbake")
    parts += [
        "## Options of every command",
        "These stand before the name of the command: `texbake --allow-outside preview hut.gltf -o "
        "hut.png`. [What a file can and cannot do](../limits.md) explains them.",
        _options(commands, group),
        "## Exit codes",
        table(("exit code", "meaning"), EXIT_CODES.items()),
        "## Standard input and output",
        "Commands with `--from` read a mesh from standard input if its name is `-`; commands with "
        "`--to` write a mesh to standard output with `-o -`, and nothing else there: `cat scan.ply "
        "| texbake convert - -o - --to glb > scan.glb`.",
    ]
    for heading, names in GROUPS.items():
        parts.append(f"## {heading}")
        for name in names:
            command = commands.get_command(group, name)
            assert command is not None
            parts += _command(command, click.Context(command, info_name=name, parent=group))
    return _page(parts)


def _links(heading: str, names: Iterable[str]) -> tuple[str, str]:
    return heading, ", ".join(f"[{name}](#texbake-{name})" for name in names)


def _command(command: click.Command, context: click.Context) -> Iterable[str]:
    yield f"### {context.command_path}"
    yield " ".join(command.collect_usage_pieces(context)).join(
        (f"```text\n{context.command_path} ", "\n```")
    )
    for paragraph in (command.help or "").strip().split("\n\n"):
        yield " ".join(paragraph.split())
    yield _options(command, context)
    lines = [line.strip() for line in (command.epilog or "").splitlines()]
    examples = [line for line in lines if line.startswith("texbake ")]
    yield "```text\n" + "\n".join(examples) + "\n```"


def _options(command: click.Command, context: click.Context) -> str:
    """Write the table of a command's options."""
    records = [parameter.get_help_record(context) for parameter in command.params]
    rows = [_option_row(*record) for record in records if record is not None and record[1]]
    return table(("option", "default", "meaning"), rows)


def _option_row(flag: str, text: str) -> tuple[str, str, str]:
    default = _DEFAULT.search(text)
    if default is None:
        return f"`{flag}`", "", text
    if default[1].startswith("x>="):  # click's words for a range
        return f"`{flag}`", "", text[: default.start()]
    return f"`{flag}`", default[1], text[: default.start()]


def pipeline_page() -> str:
    """Write every kind of step with its inputs, outputs and options."""
    schema = pipeline_schema()
    parts = ["# Pipeline files", _MADE]
    parts.append(
        "A pipeline file is a TOML file that `texbake build` runs; see [Build many "
        "assets](../how-to/build.md). `texbake schema pipeline` prints the JSON Schema of these "
        "keys, with which an editor completes and checks them."
    )
    parts += ["## The file", keys_table(schema)]
    parts += ["## [[assets]]", keys_table(schema["$defs"]["Asset"])]
    parts.append("## [steps.NAME]")
    parts.append(
        "Every step has these keys: `do`, its kind; `after`, the steps that must succeed before "
        "it; `output`, the names of the files that it publishes. An input of a step is the name of "
        "an input of the asset, or of another step, which means the first output of that step. "
        "`STEP.OUTPUT` names any of its outputs."
    )
    kinds = schema["properties"]["steps"]["additionalProperties"]["oneOf"]
    for kind, of_kind in zip(STEP_KINDS.values(), kinds, strict=True):
        parts += [f"### {kind.name}", of_kind["description"]]
        roles = {role.name for role in kind.inputs}
        inputs = [
            f"`{role.name}`{' (one or more)' * role.many}{'' if role.required else ' (optional)'}"
            for role in kind.inputs
        ]
        if inputs:
            parts.append(f"Inputs: {', '.join(inputs)}.")
        if outputs := _outputs(kind):
            parts.append(f"Outputs: {', '.join(f'`{name}`' for name in outputs)}.")
        options = keys_table(of_kind, without={"do", "after", "output", *roles})
        parts.append(options)
    return _page(parts)


# Settings without which a kind of step has no outputs.
_TOLD = {"run": {"faces": 500}, "simplify": {"faces": 500}}


def _outputs(kind: Any) -> list[str]:
    """Names of the outputs of a kind of step with its default options."""
    try:
        return list(kind.outputs(kind.settings(_TOLD.get(kind.name, {}))))
    except (OptionError, TypeError):
        return []


def scenes_page(page: str) -> str:
    """Write the tables of a page about scene files again; each follows its heading."""
    schema = scene_schema()
    for heading, model in TABLES.items():
        name = model.__name__
        keys = schema if heading == "the file" else _whole(schema["$defs"][name])
        pattern = re.compile(
            rf"(^#+ {re.escape(heading)}\n(?:(?!\||#).*\n)*)((?:\|.*\n)+)",
            re.MULTILINE | re.IGNORECASE,
        )
        table = keys_table(keys)
        page, n = pattern.subn(lambda match, table=table: f"{match[1]}{table}\n", page)
        assert n == 1, f"no table below {heading}"
    return page


def checks_page() -> str:
    """Write every kind of finding."""
    parts = ["# Checks", _MADE, _CHECKS]
    for name, kind in KINDS.items():
        parts.append(f"## {kind.title}")
        parts.append(f"`{name}`. {_plain(kind.problem)} {_plain(kind.remedy)}")
    return _page(parts)


def _plain(text: str) -> str:
    """Write a message without the figures that a finding fills in."""
    text = text.replace("{message}.", "The finding says what is wrong with the file.")
    text = re.sub(r"(?<=[.])\{[^}]*\}", "", text)  # a further sentence, where there is one
    return re.sub(r"\{[^}]*\}", "…", text)


def _whole(schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """Schema of a table that a value may stand for as well."""
    return next((part for part in schema.get("anyOf", ()) if "properties" in part), schema)


def keys_table(of: Mapping[str, Any], *, without: Iterable[str] = ()) -> str:
    """Write the keys of a table: values, default, meaning."""
    required = of.get("required", ())
    rows = []
    for key, said in of.get("properties", {}).items():
        if key not in set(without):
            text, _, default = said.get("description", "").partition(" Default: ")
            default = _toml(said.get("default")) or default.removesuffix(".")
            rows.append(
                (f"`{key}`", _values(said), "required" if key in required else default, text)
            )
    return table(("key", "values", "default", "meaning"), rows) if rows else "It has no options."


def _toml(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return f"`[{', '.join(_toml(item).strip('`') for item in value)}]`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _values(said: Mapping[str, Any]) -> str:
    """Say which values a key takes."""
    if "enum" in said:
        return ", ".join(_toml(word) for word in said["enum"])
    if "const" in said:
        return _toml(said["const"])
    for parts in ("anyOf", "oneOf"):
        if parts in said:
            words = dict.fromkeys(filter(None, map(_values, said[parts])))
            return " or ".join(words)
    if "$ref" in said or said.get("type") == "object":
        return "table"
    kind = str(said.get("type", ""))
    if kind == "array":
        n, most = said.get("minItems"), said.get("maxItems")
        count = "" if n is None or n != most else f"{n} "
        items = said.get("items", {})
        return f"list of {count}{_PLURALS.get(items.get('type'), 'values')}{_range(items)}"
    if kind == "string" and "pattern" in said:
        return '`"#rrggbb"`'
    return f"{_KINDS.get(kind, '')}{_range(said)}"


def _range(said: Mapping[str, Any]) -> str:
    low, high = said.get("minimum"), said.get("maximum")
    above, below = said.get("exclusiveMinimum"), said.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f", {low:,} to {high:,}"
    ends = [
        (low, "{:,} or more"), (above, "above {:,}"), (high, "at most {:,}"), (below, "below {:,}"),
    ]  # fmt: skip
    words = [word.format(end) for end, word in ends if end is not None]
    return f", {' and '.join(words)}" if words else ""


_PACKAGE_TITLES = {
    "": "Errors",
    "mesh": "Meshes",
    "mapping": "Texture coordinates",
    "texture": "Textures and images",
    "baking": "Baking",
    "rendering": "Pictures",
    "pages": "Notebooks",
    "checks": "Checks",
    "jobs": "Whole jobs",
    "building": "Builds",
}
_FURTHER = (
    ("texbake.errors", "all other errors, each a `TexbakeError`: `UvError`, ..."),
    ("texbake.limits", "`raised_limits`"),
    ("texbake.verbs", "commands as functions from files to files: `map_bakes.bake_normals`, ..."),
    ("texbake.jobs", "what commands share; `texbake.verbs` also checks outputs before it begins"),
    ("texbake.mesh", "`tangents.corner_tangents`, `materials`, `remesh.remesh_with_report`, ..."),
    ("texbake.mapping", "`unwrap.unwrap_with_report`, `layout_svg.layout_svg`, ..."),
    ("texbake.texture", "`mipmaps.mip_chain`, `sample.sample_texture`, `pack`, `cube_map`, ..."),
    ("texbake.baking", "`texture.photos.bake_photos`, `texture.solid`, `hits_file`, ..."),
    ("texbake.compat", "`xatlas`, with the API of xatlas-python"),
    ("texbake.rendering", "`scene.lights.Shadow`, `scene.material`, `compare_models`, ..."),
    (
        "texbake.pages",
        "`asset_page.write_bake_page`, `layout_page.write_layout_page`, "
        "`picture_pages.write_slider_page`",
    ),
    ("texbake.study", "`study.run_study`, `bench.run.run_bench`"),
)


def python_page() -> str:
    """Write a page that lists the public names; mkdocstrings fills in the docstrings."""
    stub = ast.parse((Path(texbake_package.__file__).parent / "__init__.pyi").read_text("utf-8"))
    names: dict[str, list[str]] = {}
    for node in stub.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            package, dot, _ = node.module.partition(".")
            names.setdefault(package if dot else "", []).extend(alias.name for alias in node.names)
    parts = [
        "# Python",
        _MADE,
        "`import texbake` takes a few milliseconds; each name is loaded when it is first used. A "
        "function that takes a mesh takes a `Mesh`, a `trimesh.Trimesh` or the path of a file.",
        "Without any package other than NumPy (`pip install numpy`, then `pip install --no-deps` "
        "and the wheel), these work as always: meshes, OBJ, PLY, STL and GLB files, texture "
        "coordinates, bakes, pictures, and writing PNG files. Anything that needs another library, "
        "such as reading an image, raises a `DependencyError` that says how to install it.",
    ]
    for package, title in _PACKAGE_TITLES.items():
        if package in names:
            parts += [f"## {title}", *(f"::: texbake.{name}" for name in sorted(names[package]))]
    assert set(names) <= set(_PACKAGE_TITLES), set(names) - set(_PACKAGE_TITLES)
    parts += [
        "## Further names",
        "These names are imported from their modules: `from texbake.limits import raised_limits`.",
        table(("package", "names"), ((f"`{package}`", text) for package, text in _FURTHER)),
    ]
    return _page(parts)


def pages() -> dict[Path, str]:
    """Every page that is made, by its file."""
    scenes = REFERENCE / "scenes.md"
    return {
        REFERENCE / "commands.md": commands_page(),
        REFERENCE / "pipeline.md": pipeline_page(),
        scenes: scenes_page(scenes.read_text(encoding="utf-8")),
        REFERENCE / "checks.md": checks_page(),
        REFERENCE / "python.md": python_page(),
    }


def main() -> None:
    """Write the pages."""
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
