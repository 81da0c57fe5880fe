"""Bakes: samples, all maps, time budgets, and their stages.

python tests/benchmarks/bench_bakes.py samples | maps | budgets | scans | stages
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded

import json
import math
import platform
import re
import tempfile
import time
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from harness import DATA, PAIRS, SCENES, in_child, in_turn, read_pair, run_commands, table

import texbake
from texbake import progress
from texbake.errors import TexbakeError
from texbake.mesh.shapes import grid_sphere, uv_sphere
from texbake.study.bench.programs import PROGRAMS, run_process
from texbake.study.options import BLENDER_VARIABLE, BenchOptions

BOUNDS = ("4deg", "2deg", "1deg", "0.7deg", "0.5deg", "0.35deg", "0.25deg", "0.12deg",
          "0.06deg", "0.03deg")  # fmt: skip
FIGURES = ("mean", "rms", "99 %", "99.9 %", "greatest")


def degrees_between(a, b):
    """Angles between unit vectors."""
    return np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=-1) / 2, 1)))


def samples(*pairs, rounds=3, size=1024):
    """Error against time of fixed and adaptive samples.

    The error is the angle to a bake with 64 rays per texel, over the texels that both cover. Times
    are processor seconds of one thread, the least of the rounds, with the check of 1 % of the
    texels. The second table has the time and the rays at the error of 16 rays per texel, as shares
    of their cost; between two bounds the error is taken to fall as a power of the cost.
    """
    for name in pairs or PAIRS:
        high, low = read_pair(name)
        report = texbake.bake(high, low, texbake.BakeOptions(size=64)).report
        same = {"size": size, "front": report.front, "back": report.back, "threads": 1}
        truth = texbake.bake(high, low, texbake.BakeOptions(**same, samples=64))
        settings = {f"{n}": {"samples": n} for n in (1, 4, 16)}
        settings |= {bound: {"max_error": bound} for bound in BOUNDS}
        runs = in_turn(
            {
                key: partial(texbake.bake, high, low, texbake.BakeOptions(**same, **more))
                for key, more in settings.items()
            },
            rounds,
        )
        print(f"\n{name}\n")
        row = table("samples", "seconds", "of 16", "rays per texel", *FIGURES)
        rows = {}
        for key, found in runs.items():
            both = found.result.has_data & truth.has_data
            normals = [bake.maps["normal"].values[both].astype(float)
                       for bake in (found.result, truth)]  # fmt: skip
            angles = degrees_between(*normals)
            rays = found.result.report.counts.rays_cast / truth.has_data.sum()
            errors = (angles.mean(), np.sqrt((angles**2).mean()),
                      *np.percentile(angles, [99, 99.9, 100]))  # fmt: skip
            rows[key] = min(found.seconds), rays, errors
            share = min(found.seconds) / min(runs["16"].seconds)
            row(key, f"{min(found.seconds):.2f}", f"{share:.2f}", f"{rays:.2f}",
                *(f"{error:.3g}°" for error in errors))  # fmt: skip
        print()
        row = table("error as of 16 samples", "time of 16", "rays of 16")
        for i, figure in enumerate(FIGURES):
            errors = [rows[bound][2][i] for bound in BOUNDS]
            row(figure, *(
                share_at(errors, [rows[bound][cost] / rows["16"][cost] for bound in BOUNDS],
                         rows["16"][2][i])
                for cost in (0, 1)
            ))  # fmt: skip


def share_at(errors, shares, goal):
    """Share of the cost at which the error falls to a goal, as text."""
    if errors[0] <= goal:
        return f"below {shares[0]:.2f}"
    for k in range(1, len(errors)):
        if errors[k] <= goal:
            part = np.log(errors[k - 1] / goal) / np.log(errors[k - 1] / errors[k])
            return f"{shares[k - 1] * (shares[k] / shares[k - 1]) ** part:.2f}"
    return "not reached"


def maps(*pairs, rounds=5, size=(1024, 2048), samples=1):
    """All maps without secondary rays in one bake, against the normal map alone.

    The high-poly mesh of a pair gets colors, texture coordinates, an image and groups, so that
    every map has values. Processor seconds of one thread, the least of the rounds.
    """
    from texbake.baking.maps import MAPS

    every = tuple(
        name
        for name, kind in MAPS.items()
        if kind.needs == "hits" and name != "world-position" and has_values(name)
    )
    sets = {"normal": ("normal",), "all": every}
    sets |= {f"+ {other}": ("normal", other) for other in every[1:]}
    print(f"{len(every)} maps: {', '.join(every)}\n")
    row = table("pair", "size", "normal, s", "all, s", "times", "with files: normal, s", "all, s",
                "times")  # fmt: skip
    added = {}
    for name in pairs or ("koala", "skull"):
        for side in size:
            least = least_seconds(name, side, samples, rounds, sets)
            (one, one_written), (whole, whole_written) = least["normal"], least["all"]
            row(name, side, f"{one:.3f}", f"{whole:.3f}", f"{whole / one:.2f}",
                f"{one_written:.3f}", f"{whole_written:.3f}",
                f"{whole_written / one_written:.2f}")  # fmt: skip
            added[f"{name} {side}"] = {key: pair[0] - one for key, pair in least.items()}
    print()
    row = table("added to the normal map, ms", *added)
    for key in sets:
        if key.startswith("+ "):
            row(key[2:], *(f"{1e3 * column[key]:.0f}" for column in added.values()))


def has_values(name):
    """Whether a model with colors, groups and an image has a map."""
    high, low, materials = with_everything(uv_sphere(4, 6), uv_sphere(4, 6))
    options = texbake.BakeOptions(size=8, maps=(name,))
    try:
        texbake.bake(high, low, options, materials=materials)
    except TexbakeError:
        return False
    return True


def with_everything(high, low):
    """Give a high-poly mesh colors, texture coordinates and groups, and materials with an image."""
    from texbake.mesh.materials import Materials

    least, greatest = high.bounds
    shares = (high.positions - least) / (greatest - least)
    high = high.replace(
        colors=shares.astype(np.float32), uvs=shares[:, :2], uv_faces=high.faces,
        face_groups=(np.arange(high.n_faces) * 7 // high.n_faces).astype(np.int32),
        group_names=tuple(f"part {i}" for i in range(7)),
    )  # fmt: skip
    return high, low, Materials.of_image(high, DATA / "textures" / "earth.ppm")


def least_seconds(name, size, samples, rounds, sets):
    """Least seconds of each set of maps: baked, and baked and written."""
    high, low, materials = with_everything(*read_pair(name))

    def once(names):
        options = texbake.BakeOptions(maps=names, threads=1, size=size, samples=samples)
        start = time.process_time()
        result = texbake.bake(high, low, options, materials=materials)
        taken = time.process_time() - start
        with tempfile.TemporaryDirectory() as folder:
            result.write(folder)
        return taken, time.process_time() - start

    times = {key: [] for key in sets}
    for _ in range(rounds + 1):  # the first compiles
        for key, names in sets.items():
            times[key].append(once(names))
    return {key: np.min(found[1:], axis=0) for key, found in times.items()}


PICTURES = ("orange_bump", "shadow_spot", "reflection", "transparency", "normal_map", "checker")
BUDGET_SIZES = {"bake": (512, 1024, 2048), "preview": (640, 1280)}
LEAST = 0.01  # seconds: too short for anything


def budgets(*kinds, times=(1.3, 2.0, 4.0)):
    """How well bakes and pictures keep to `--time-budget`, and what they make of the time.

    Every run is a process of its own. Budgets are multiples of the time of a run with a budget of a
    hundredth of a second, in processor seconds of one thread. A star marks runs that reached the
    closest bound; of the others, a line says how many ended between 85 % and 100 % of their budget.
    Errors of bakes are root mean squares of the angle to 64 rays per texel, of the bake and of the
    best of 1, 4 and 16 rays that took no longer.
    """
    for kind in kinds or BUDGET_SIZES:
        heads = ["name", "size", "budget, s", "spent", "whole process", "bound", "rounds"]
        print(f"\n{kind}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors\n")
        row = table(*heads, *["error", "fixed", "quotient"] * (kind == "bake"))
        shares = []
        with tempfile.TemporaryDirectory() as folder:
            for name in PAIRS if kind == "bake" else PICTURES:
                for size in BUDGET_SIZES[kind]:
                    shares += keep_budgets(row, (kind, name, size, Path(folder)), times)
        spent = np.array(shares)
        n_within = np.count_nonzero((spent >= 0.85) & (spent <= 1.0))
        print(f"\n{n_within} of {len(spent)} between 85 % and 100 %, "
              f"{np.count_nonzero(spent > 1.0)} above; least, median, greatest "
              f"{', '.join(f'{x:.0%}' for x in np.percentile(spent, [0, 50, 100]))}")  # fmt: skip


def keep_budgets(row, case, times):
    """Print a row for each budget; return the shares that were spent."""
    least = budget_run(case, time_budget=LEAST)[0]
    is_bake = case[0] == "bake"
    fixed = []
    if is_bake:
        truth = normals_of(budget_run(case, samples=64)[2])
        for n in (1, 4, 16):
            seconds, _, path = budget_run(case, samples=n)
            fixed.append((seconds, n, angle_to(truth, path)))
    shares = []
    for factor in times:
        budget = round(factor * least, 2)
        seconds, figures, path = budget_run(case, time_budget=budget)
        share = figures["actual_seconds"] / budget
        is_ample = figures["why"] == "the closest bound that is wanted"
        shares += [] if is_ample else [share]
        cells = []
        if is_bake:
            error = angle_to(truth, path)
            fitting = [one for one in fixed if one[0] <= seconds]
            _, n, best = min(fitting, key=lambda one: one[2], default=(0, 0, np.nan))
            cells = [f"{error:.4f}°", f"{best:.4f}° ({n})", f"{error / best:.2f}"]
        row(*case[1:3], f"{budget:.2f}", f"{share:.0%}{' *' * is_ample}", f"{seconds / budget:.0%}",
            figures["max_error"], len(figures["rounds"]), *cells)  # fmt: skip
    return shares


def budget_run(case, **options):
    """Seconds, figures of the budget and the file of one bake or picture in a process."""
    seconds = in_child(run_here, *case, options)
    report = json.loads((case[-1] / "report.json").read_text())
    return seconds, report.get("budget"), case[-1] / "out.png"


def run_here(kind, name, size, folder, options):
    """Bake or draw in this process; return its processor seconds."""
    from texbake.jobs.maps import bake_files
    from texbake.sampling.rounds import BudgetClock
    from texbake.verbs.preview import preview_files

    clock = BudgetClock(start=0.0, now=time.process_time)
    output, report = f"{folder}/out.png", Path(folder) / "report.json"
    if kind == "bake":
        meshes = [DATA / "pairs" / name / file for file in ("high.obj", "low_uv.obj")]
        # Without padding, texels that are not covered are flat.
        options = texbake.BakeOptions(size=size, threads=1, padding=0, **options)
        done = bake_files(*meshes, {"normal": output}, options, clock=clock)
        report.write_text(json.dumps(done.to_json(), default=str))
    else:
        options |= {"width": size, "height": size * 5 // 8}
        scene = SCENES / f"{name}.toml"
        preview_files(scene, output, options, threads=1, clock=clock, report=report)
    return time.process_time()


def normals_of(path):
    """Unit normals of a map."""
    from texbake.texture.encoding import decode_normals
    from texbake.texture.image import read_image

    return decode_normals(read_image(path, color=False).pixels)


def angle_to(truth, path):
    """Root mean square of the angle to other normals, over the texels that both cover."""
    normals = normals_of(path)
    shown = (np.abs(truth - [0, 0, 1]) > 1e-4).any(axis=2)
    shown &= (np.abs(normals - [0, 0, 1]) > 1e-4).any(axis=2)
    return float(np.sqrt(np.square(degrees_between(normals, truth)[shown]).mean()))


COPIED, MATRIX = 256 << 20, 768
# Arithmetic operations in floating point of one item. A triangle: its corners into the local frame,
# its Morton code, a box. A ray: position and direction from the low-poly corners, its share of the
# nodes and triangles that its bundle tests, 2.7 exact tests of 60 each. A hit: the normal of the
# high-poly mesh, the tangent frame, its inverse. A texel that is written: scale and round.
OPERATIONS = {"tree": ("triangle", 60), "rays and hits": ("ray", 430), "maps": ("hit", 130),
              "encode": ("texel", 9)}  # fmt: skip


def scans(*files, faces=5_000, size=2048, rounds=3, out="", least=50_000):
    """Time of a normal map of real scans, beside Blender's, as whole processes.

    Without files, it takes all meshes of the data folder with at least `least` triangles. `texbake
    run` makes the low-poly meshes. Both programs cast one ray per texel, from 2 % of the diagonal
    in front to 2 % behind; texbake also bakes with distances that it measures. Times are seconds
    by the clock, with reading and writing files. `out` keeps the pairs for the next run.
    """
    options = BenchOptions(blender=os.environ.get(BLENDER_VARIABLE))
    row = table("pair", "triangles", "given distances", "measured distances", "Blender",
                "Blender / given", "Blender / measured")  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        for file in map(Path, files or scan_files()):
            name = file.parent.name if file.stem == "high" else file.stem
            pair = scan_pair(file, Path(out or folder) / name, faces, least)
            if pair is None:
                continue
            high, low, n_faces, distance = pair
            job = {"task": "bake-normals", "high": str(high), "low": str(low), "padding": 16,
                   "distance": distance, "size": size, "samples": 1}  # fmt: skip
            stem = Path(folder) / "map"
            given = PROGRAMS["texbake"].command(job, stem, options)[0]
            cut = given.index("--front")
            commands = {
                "given": given,
                "measured": given[:cut] + given[cut + 4 :],
                "Blender": PROGRAMS["blender"].command(job, stem, options)[0],
            }
            runs = in_turn(
                {key: partial(run_process, line, timeout=3600) for key, line in commands.items()},
                rounds,
                time.perf_counter,
            )
            faults = [f"{key}: {run.result.fault}" for key, run in runs.items() if run.result.fault]
            if faults:
                row(name, f"{n_faces:,}", *faults)
                continue
            given, measured, blender = runs.values()
            row(name, f"{n_faces:,}", given.cell(), measured.cell(), blender.cell(),
                blender.times(given, 1), blender.times(measured, 1))  # fmt: skip


def scan_files():
    """Meshes of the data folder, and the high-poly meshes of its pairs."""
    for kind in ("meshes", "broken", "pairs"):
        for path in sorted((DATA / kind).rglob("*")):
            if path.suffix.lower() in (".ply", ".obj", ".glb", ".stl") and "low" not in path.stem:
                yield path


def scan_pair(file, folder, faces, least):
    """The files of a pair, its number of triangles and 2 % of its diagonal; None if it is small."""
    mesh = texbake.read_mesh(file)
    if mesh.n_faces < least:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    high, low = folder / "high.ply", folder / "high_low.obj"
    if not low.exists():
        bare = texbake.Mesh(positions=mesh.positions.astype(np.float32), faces=mesh.faces)
        texbake.write_mesh(bare, high)
        options = texbake.RunOptions(n_faces=faces, size=1024)
        texbake.run(texbake.read_mesh(high), folder, options)
    return high, low, mesh.n_faces, 0.02 * mesh.diagonal


def stages(triangles=4_000_000, sizes=(2048, 4096), rounds=3):
    """Where the time of a bake goes, and how near each stage is to what the machine can do.

    A displaced sphere, as binary PLY, is baked onto 512 triangles: a normal map as 16-bit PNG with
    16 texels of padding. Processor seconds of one thread, the least of the rounds. Bytes are those
    that a stage must move at the least, operations are estimates; both are compared with a copy of
    large arrays and a product of matrices in the same run.
    """
    if hasattr(os, "sched_setaffinity"):  # readers take no number of threads
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    progress.time = SimpleNamespace(perf_counter=time.process_time)  # of the stages of a bake
    with tempfile.TemporaryDirectory() as name:
        folder, n_rows = Path(name), math.isqrt(triangles // 4)
        high = grid_sphere(
            n_rows, 2 * n_rows, lambda t, p: 1 + 0.02 * np.sin(40 * t) * np.sin(40 * p)
        )
        high = high.replace(positions=high.positions.astype(np.float32))
        texbake.write_mesh(high, folder / "high.ply")
        texbake.write_mesh(uv_sphere(17, 16), folder / "low.obj")
        print(*stage_tables(folder, sizes, rounds), sep="\n")


def seconds_of(work):
    start = time.process_time()
    work()
    return time.process_time() - start


def stage_tables(folder, sizes, rounds):
    source, target = np.ones(COPIED // 8), np.empty(COPIED // 8)
    matrix = np.random.default_rng(0).random((MATRIX, MATRIX))
    copy = min(seconds_of(lambda: np.copyto(target, source)) for _ in range(2 * rounds + 1))
    product = min(seconds_of(lambda: matrix @ matrix) for _ in range(4 * rounds + 1))
    bandwidth, arithmetic = 2 * COPIED / copy, 2 * MATRIX**3 / product
    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text("utf-8"))
    yield (
        f"One thread of {model[1].strip() if model else platform.processor()} copies "
        f"{bandwidth / 1e9:.1f} GB/s, read and written,\n"
        f"and does {arithmetic / 1e9:.0f} billion operations in float64 per second."
    )
    for size in sizes:
        found = [bake_once(folder, size) for _ in range(rounds)]
        seconds = {stage: min(one[stage] for one, _ in found) for stage in found[0][0]}
        counts = found[0][1]
        yield f"\n{counts['triangle']:,} triangles at {size}², {counts['ray']:,} rays:\n"
        yield "| stage | seconds | MB moved | of the bandwidth | billion operations | of the peak |"
        yield "|---|---|---|---|---|---|"
        moved, at_best = moved_bytes(counts), 0.0
        for stage, n_bytes in moved.items():
            taken = max(seconds[stage], 1e-9)
            item, each = OPERATIONS.get(stage, ("", 0))
            n = each * counts.get(item, 0)
            at_best += max(n_bytes / bandwidth, n / arithmetic)
            work = f"{n / 1e9:.2f} | {n / taken / arithmetic:.0%}" if n else " | "
            yield (f"| {stage} | {taken:.3f} | {n_bytes / 1e6:.0f} "
                   f"| {n_bytes / taken / bandwidth:.0%} | {work} |")  # fmt: skip
        whole = sum(seconds.values())
        yield f"| all | {whole:.3f} | {sum(moved.values()) / 1e6:.0f} | | | |"
        yield (f"\nAt the machine's limits, all stages together would take {at_best:.2f} s, "
               f"{whole / at_best:.1f} times less.")  # fmt: skip


def bake_once(folder, size):
    """Processor seconds of each stage of one bake from file to file, and what it worked on."""
    options = texbake.BakeOptions(size=size, front=0.1, back=0.1, padding=16, bits=16, threads=1)
    seconds, files = {}, (folder / "high.ply", folder / "low.obj")
    start = time.process_time()
    high, low = map(texbake.read_mesh, files)
    seconds["read"] = time.process_time() - start
    result = texbake.bake(high, low, options)
    stages = {record.name: record.seconds for record in result.report.stages}
    seconds["tree"] = stages.pop("build ray tree")
    seconds["pad"] = stages.pop("pad")
    seconds["maps"] = stages.pop("make maps")
    seconds["rays and hits"] = sum(stages.values())
    out = folder / "map.png"
    whole = seconds_of(lambda: result.write(out))
    content = out.read_bytes()
    seconds["write"] = seconds_of(lambda: (folder / "copy.png").write_bytes(content))
    seconds["encode"] = max(whole - seconds["write"], 0.0)
    n_rays = result.report.counts.rays_cast
    counts = {
        "triangle": high.n_faces, "vertex": high.n_vertices, "ray": n_rays, "hit": n_rays,
        "texel": size * size, "read": sum(path.stat().st_size for path in files),
        "written": len(content),
    }  # fmt: skip
    return seconds, counts


def moved_bytes(counts):
    """Bytes that go into each stage and come out of it."""
    mesh = 24 * counts["vertex"] + 12 * counts["triangle"]
    # A leaf of eight holds 9 float64 and a face number for each, a node 6 float32 for each of 8.
    tree = (72 + 4 + 24 / 7) * counts["triangle"]
    hits = (4 + 4 + 4 + 8 + 8 + 12) * counts["hit"]  # texel, faces, barycentrics, offset
    values = 12 * counts["texel"]
    return {
        "read": counts["read"] + mesh, "tree": mesh + tree, "rays and hits": tree + hits,
        "maps": hits + 12 * counts["vertex"] + values, "pad": 2 * values,
        "encode": values + counts["written"], "write": 2 * counts["written"],
    }  # fmt: skip


if __name__ == "__main__":
    run_commands(globals(), samples, maps, budgets, scans, stages)
