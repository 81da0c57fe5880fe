"""A checkout without a core: it uses the installed one, compiles its own, or says what to do."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from texbake.core.builds import find_builds, library_name, sources_checksum

CHECKOUT = Path(__file__).parents[2]
CALL = "from texbake.core import core; core.library; print(core.library._name)"
# A fake compiler: it compiles nothing, and "links" by copying an existing library.
COMPILER = """#!/bin/sh
for word; do made=$word; done
case " $* " in
*" -c "*) ;;
*) cp "{library}" "$made"; echo "$made" >>"{log}" ;;
esac
"""


@pytest.fixture
def checkout(tmp_path):
    """The sources without a core, in a folder of their own."""
    ignored = shutil.ignore_patterns("core-*", "__pycache__")
    shutil.copytree(CHECKOUT / "texbake", tmp_path / "checkout" / "texbake", ignore=ignored)
    shutil.copytree(CHECKOUT / "cli", tmp_path / "checkout" / "cli", ignore=ignored)
    return tmp_path / "checkout"


@pytest.fixture
def install(tmp_path, checkout):
    def installed():
        folder = tmp_path / "installed" / "texbake" / "core"
        folder.mkdir(parents=True)
        checksum = sources_checksum(checkout / "texbake" / "core")
        for level, path in find_builds().items():
            shutil.copy(path, folder / library_name(level, checksum))
        return folder

    return installed


@pytest.fixture
def compiler(tmp_path):
    """A compiler that takes no time, and logs what it links."""
    path = tmp_path / "compiler"
    library = str(max(find_builds().values()))
    log = str(tmp_path / "linked")
    path.write_text(COMPILER.format(library=library, log=log))
    path.chmod(0o755)
    return path


@pytest.fixture
def start(tmp_path, checkout):
    """Function that starts Python in the checkout's root, as a reader of the README does."""

    def started(*words, compiler):
        environment = {
            **os.environ, "PYTHONPATH": str(tmp_path / "installed"),
            "XDG_CACHE_HOME": str(tmp_path / "cache"), "CC": str(compiler),
        }  # fmt: skip
        for name in "TEXBAKE_CORE", "LD_PRELOAD":  # of a core with sanitizers
            environment.pop(name, None)
        return subprocess.Popen(
            [sys.executable, *words], cwd=checkout, env=environment, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    return started


def change(checkout):
    """Change the sources, so that no build fits them."""
    with (checkout / "texbake" / "core" / "quadtree.c").open("a") as file:
        file.write("/* changed */\n")


linux = pytest.mark.skipif(sys.platform != "linux", reason="its cache is elsewhere")


@linux
def test_a_checkout_uses_the_installed_core_of_its_sources(start, install, checkout, tmp_path):
    folder = install()
    output, _ = start("-c", CALL, compiler="none").communicate()
    assert Path(output.strip()).parent == folder
    made = start("-m", "texbake", "make", "plane", "-o", "plane.obj", "--quiet", compiler="none")
    assert made.communicate() == ("", "")
    assert (checkout / "plane.obj").is_file()
    assert not (tmp_path / "cache").exists()


@linux
def test_one_core_is_compiled_for_other_sources(start, install, checkout, compiler, tmp_path):
    install()
    change(checkout)
    processes = [start("-c", CALL, compiler=compiler) for _ in range(3)]
    for process in processes:
        output, messages = process.communicate()
        assert Path(output.strip()).parent == tmp_path / "cache" / "texbake", messages
    linked = [Path(line).name for line in (tmp_path / "linked").read_text().splitlines()]
    assert len(linked) == len(set(linked)) == len(find_builds())


@linux
def test_an_interrupted_build_leaves_no_level_in_the_cache(start, checkout, compiler, tmp_path):
    """A lone build of the lowest level would be taken from then on."""
    change(checkout)
    last = f"*core-{max(find_builds())}*) kill $PPID ;;"
    compiler.write_text(compiler.read_text().replace("*) cp", f"{last}\n*) cp"))
    _, messages = start("-c", CALL, compiler=compiler).communicate()
    assert "no compiled core" in messages
    assert not list((tmp_path / "cache").rglob("core-*"))


@linux
def test_without_a_compiler_one_line_says_what_to_do(start, checkout):
    change(checkout)
    (checkout / "triangle.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    process = start("-m", "texbake", "info", "triangle.obj", compiler="no-compiler")
    _, messages = process.communicate()
    assert process.returncode == 1
    *notes, error = messages.splitlines()
    assert set(notes) <= {f"texbake: compiling the core for {checkout}, once"}
    assert error == (
        f"texbake: there is no compiled core for the sources in {checkout}: CC: there is no "
        f"program 'no-compiler'; name a C compiler, or unset CC; run: pip install {checkout}"
    )


def test_without_any_compiler_the_error_is_one_line():
    script = CHECKOUT / "texbake" / "core" / "compile_core.py"
    done = subprocess.run(  # -S: no installed package is available
        [sys.executable, "-S", str(script)], env={"PATH": ""}, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr == "texbake: there is no C compiler, and the package ziglang is missing\n"


@pytest.mark.parametrize("name", ["quadtree.c", "core.h", "compile_core.py"])
def test_the_checksum_changes_with_every_source_of_a_build(checkout, name):
    folder = checkout / "texbake" / "core"
    before = sources_checksum(folder)
    assert before == sources_checksum(CHECKOUT / "texbake" / "core")
    with (folder / name).open("a") as file:
        file.write("\n")
    assert sources_checksum(folder) != before


def test_an_installed_package_has_no_sources_to_fit(tmp_path):
    assert sources_checksum(tmp_path) == ""
