"""What a fresh process imports for a command: only what the command needs.

Times are not measured here; what is imported decides most of the time of a command on a small mesh.
"""

import subprocess
import sys

# Each takes 40 ms or more to import; numpy takes as long, and no command on meshes is without it.
# Below them, modules of texbake that no command on OBJ and PLY files needs.
HEAVY = frozenset({
    "OpenImageIO", "PIL", "jinja2", "matplotlib", "meshoptimizer", "pydantic",
    "pymeshlab", "rich", "scipy", "skimage", "ssl", "trimesh", "xatlas",
    "texbake.mesh.files.fbx_scene", "texbake.mesh.files.gltf_document",
    "texbake.rendering.compare_models", "texbake.texture.material_images",
})  # fmt: skip


def test_the_help_of_all_commands_loads_none_of_them(tmp_path):
    code = (
        "import sys\n"
        "from click.testing import CliRunner\n"
        "from texbake_cli.main import texbake\n"
        "assert CliRunner().invoke(texbake, ['--help']).exit_code == 0\n"
        "print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True
    )
    names = set(done.stdout.split())
    assert not names & {"numpy", "texbake.core", "texbake.schema", "texbake_cli.pipelines"}


# Lines that need none of them, in one process; the first two write the meshes of the others.
LIGHT = """
make sphere -o low.obj --resolution 12x8
make sphere -o high.ply --resolution 24x16
info low.obj
convert low.obj converted.ply
repair low.obj -o repaired.ply
transform low.obj -o moved.ply --scale 2
remesh high.ply -o closed.ply --resolution 32
unwrap low.obj -o fast.obj --size 64 --quality fast
unwrap low.obj -o good.obj --size 64
unwrap low.obj -o layout.obj --size 64 --quality fast --layout layout.svg
preview low.obj -o picture.png --size 32x32
bake-texture low.obj -o marble.png --procedure marble --size 32
bake high.ply low.obj -o maps --size 32
bake-normals high.ply low.obj -o normal.png --size 32
check high.ply low.obj --fail-on never
cage high.ply low.obj -o cage.obj
"""
NEEDING = {
    "simplify high.ply -o less.ply --faces 100": "meshoptimizer",
    "compare high.ply low.obj -o compared.png --size 32x32": "PIL",
}


def test_a_command_loads_what_it_needs(tmp_path):
    code = (
        "import sys\n"
        "from texbake_cli.main import texbake\n"
        "for line in sys.argv[1:]:\n"
        "    texbake(line.split(), prog_name='texbake', standalone_mode=False)\n"
        "    print('loaded after', line, *sys.modules, sep='\t')"
    )
    lines = [*LIGHT.strip().splitlines(), *NEEDING]
    done = subprocess.run(
        [sys.executable, "-P", "-c", code, *lines],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = [row.split("\t") for row in done.stdout.splitlines() if row.startswith("loaded after")]
    loaded = {line: HEAVY.intersection(names) for _, line, *names in rows}
    allowed = set()
    for line in lines:
        allowed.add(NEEDING.get(line))
        assert loaded[line] <= allowed, line
