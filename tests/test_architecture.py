"""The import rules between packages, checked on all imports, also those inside functions."""

import ast
import re
import sys
import tomllib
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# A package imports from itself and from those before it; the first is texbake/ itself, without its
# __init__.py, which points into every package.
PACKAGES = (
    "", "core", "mesh", "raycast", "mapping", "texture", "sampling", "baking", "rendering",
    "checks", "pages", "jobs", "verbs", "building", "study", "compat",
)  # fmt: skip
# ... and these do not import each other.
STRANGERS = {("baking", "rendering"), ("rendering", "baking")}
MAX_MODULE_LINES = 400
MAX_BODY_LINES = 60


def name_of(path):
    parts = list(path.relative_to(ROOT).with_suffix("").parts)
    if parts[0] == "cli":
        parts[0] = "texbake_cli"
    if parts[-1] == "__init__":
        parts.pop()
    return ".".join(parts)


@cache
def modules():
    paths = [*ROOT.glob("texbake/**/*.py"), *ROOT.glob("cli/**/*.py")]
    return {name_of(path): path for path in sorted(paths)}


@cache
def tree_of(module):
    return ast.parse(modules()[module].read_text(encoding="utf-8"))


def for_type_checkers(tree):
    """Every node below an `if TYPE_CHECKING:`."""
    return {
        below
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for statement in node.body
        for below in ast.walk(statement)
    }


@cache
def imports_of(module, *, when_run=False):
    """Full names of what a module imports; `when_run` leaves out what only type checkers see."""
    return tuple(found_imports(module, when_run=when_run))


def found_imports(module, *, when_run):
    tree = tree_of(module)
    skipped = for_type_checkers(tree) if when_run else set()
    is_package = modules()[module].name == "__init__.py"
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parts = module.split(".")
                kept = parts[: len(parts) - node.level + is_package]
                base = ".".join([*kept, base]) if base else ".".join(kept)
            for alias in node.names:
                # `from package import module` and `from module import name` look alike.
                full = f"{base}.{alias.name}"
                yield full if full in modules() else base


def package_of(module):
    parts = module.split(".")
    is_package = modules()[module].name == "__init__.py"
    return parts[1] if is_package or len(parts) > 2 else ""


def in_texbake(module):
    return module.split(".")[0] == "texbake"


def test_the_reader_of_imports_sees_them_all():
    # The other tests rely on it: an import at the top, in a function, and a relative one.
    assert "texbake.errors" in imports_of("texbake.files")
    assert "resource" in imports_of("texbake.progress")
    assert "texbake_cli.messages" in imports_of("texbake_cli.main")
    assert "texbake.mesh.mesh" in imports_of("texbake.rendering.scene.lights")
    assert "texbake.mesh.mesh" not in imports_of("texbake.rendering.scene.lights", when_run=True)


def test_every_module_is_in_a_known_package():
    packages = {package_of(module) for module in modules() if module.startswith("texbake.")}
    assert packages <= set(PACKAGES)


def test_a_package_imports_only_from_packages_above_it():
    wrong = []
    for module in filter(in_texbake, modules()):
        if module == "texbake":
            continue
        here = package_of(module)
        for imported in filter(in_texbake, imports_of(module)):
            if imported == "texbake":  # its version
                continue
            there = package_of(imported)
            below = PACKAGES.index(there) > PACKAGES.index(here)
            if below or (here, there) in STRANGERS:
                wrong.append(f"{module} imports {imported}")
    assert not wrong


def test_texbake_does_not_know_the_command_line():
    wrong = [
        f"{module} imports {imported}"
        for module in filter(in_texbake, modules())
        for imported in imports_of(module)
        if imported.split(".")[0] in {"texbake_cli", "click", "rich"}
    ]
    assert not wrong


def test_the_command_line_imports_only_texbake_and_libraries_of_the_terminal():
    allowed = {"click", "rich", "texbake", "texbake_cli"} | sys.stdlib_module_names
    wrong = [
        f"{module} imports {imported}"
        for module in modules()
        if not in_texbake(module)
        for imported in imports_of(module)
        if imported.split(".")[0] not in allowed
    ]
    assert not wrong


def test_machine_code_comes_from_the_core_alone():
    compilers = {"numba", "llvmlite", "cffi", "Cython", "taichi"}
    users = {
        module
        for module in modules()
        for imported in imports_of(module)
        if imported.split(".")[0] in compilers
    }
    assert users == set()


def test_no_module_imports_itself_by_a_detour():
    graph = {
        module: {name for name in imports_of(module, when_run=True) if name in modules()} - {module}
        for module in modules()
    }
    circle = []
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        circle = error.args[1]
    assert circle == []


def test_every_module_reads_in_one_sitting():
    lengths = {
        module: len(path.read_text(encoding="utf-8").splitlines())
        for module, path in modules().items()
    }
    assert {m: n for m, n in lengths.items() if n > MAX_MODULE_LINES} == {}


def functions_of(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def test_every_function_fits_on_one_screen():
    too_long = []
    for module in modules():
        for function in functions_of(tree_of(module)):
            body = function.body[1:] if ast.get_docstring(function) else function.body
            lines = (body[-1].end_lineno or 0) - body[0].lineno + 1 if body else 0
            if lines > MAX_BODY_LINES:
                too_long.append(f"{module}.{function.name}: {lines} lines")
    assert not too_long


def public_definitions(module):
    """Public functions and classes of a module, and the public methods of those classes."""
    for node in tree_of(module).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
            for member in node.body if isinstance(node, ast.ClassDef) else ():
                if isinstance(member, ast.FunctionDef) and not member.name.startswith("_"):
                    yield f"{node.name}.{member.name}", member


def test_everything_public_has_a_docstring():
    silent = [module for module in modules() if not ast.get_docstring(tree_of(module))]
    for module in modules():
        for name, node in public_definitions(module):
            assert isinstance(node, ast.FunctionDef | ast.ClassDef)
            if not ast.get_docstring(node):
                silent.append(f"{module}.{name}")
    assert not silent


def test_every_package_is_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = {module for module, path in modules().items() if path.name == "__init__.py"}
    assert set(project["tool"]["setuptools"]["packages"]) == packages
    # A folder of modules without an __init__.py would be left out of the wheel.
    assert {module.rpartition(".")[0] for module in modules()} - {""} <= packages


def test_tests_start_the_installed_package():
    """Without `-P`, Python takes the sources in the current folder, which may have no core."""
    starts = re.compile(r"\[\s*sys\.executable,\s*\"-[cm]\"")
    assert [
        path.name
        for path in (ROOT / "tests").rglob("test_*.py")
        if starts.search(path.read_text("utf-8"))
    ] == []


# Functions that round, or order equal values, differently on other processors. portable_math and
# elementary.h of texbake.core replace those that round.
_OF_MATH = (
    "sin|cos|tan|exp2?|expm1|log(2|10|1p)?|pow|atan2?|asin|acos|hypot|dist|cbrt|(sin|cos|tan)h"
)
_OF_NUMPY = (
    f"{_OF_MATH}|sinc|logaddexp|power|float_power|arctan2|arc(sin|cos|tan)h?|i0|angle|einsum|v?dot|"
    "inner|tensordot|matmul|vecdot|matvec|vecmat|linalg|fft|convolve|correlate|polyfit|roots|cov|"
    "corrcoef|partition|argpartition|interp"
)
_OF_C = r"(?:sin|cos|tan|exp2?|log(?:2|10|1p)?|pow|a?(?:sin|cos|tan)h?|atan2|hypot|cbrt|fma)f?"


def unportable(node):
    """Whether an expression may give different bits on another processor."""
    if isinstance(node, ast.BinOp):
        if isinstance(node.op, ast.MatMult):
            return True
        # Squares are products, and small powers of whole numbers are exact.
        sides = ast.unparse(node.left), ast.unparse(node.right)
        return isinstance(node.op, ast.Pow) and not any(re.fullmatch(r"-?\d+", s) for s in sides)
    if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "argsort":
        return not any(ast.unparse(keyword.value) == "'stable'" for keyword in node.keywords)
    if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Name):
        return False
    names = {"np": _OF_NUMPY, "math": _OF_MATH}.get(node.value.id)
    return names is not None and re.fullmatch(names, node.attr) is not None


@pytest.mark.parametrize("source", ["np.sin(x)", "a @ b", "x**0.4", "math.log(2)", "x.argsort()"])
def test_unportable_expressions_are_found(source):
    assert any(map(unportable, ast.walk(ast.parse(source))))


def test_packages_use_only_portable_functions():
    found = [
        f"{module}:{node.lineno}: {ast.unparse(node)}"
        for module in modules()
        # Runners run in the Python of other programs.
        if not module.startswith(("texbake.study.bench.runners.", "texbake.core.portable_math"))
        for node in ast.walk(tree_of(module))
        if unportable(node)
    ]
    for path in sorted((ROOT / "texbake" / "core").glob("*.[ch]")):
        code = re.sub(r"/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        found += [f"{path.name}: {name}" for name in re.findall(rf"\b({_OF_C})\(", code)]
    assert not found
