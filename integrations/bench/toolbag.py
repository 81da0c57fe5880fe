"""Bench Marmoset Toolbag 4 or 5, by Python scripts that it runs.

    python integrations/bench/toolbag.py cases --toolbag "C:/Program Files/.../toolbag.exe"

Nobody has run this yet: it follows https://www.marmoset.co/python/reference5.html. `--dry-run`
writes the scripts and starts nothing. Heights are left out, because Toolbag scales them to a
range.
"""

from adapter import do_jobs, parser

# Toolbag's name of a map, and what it appends to the name of the file.
MAPS = {"bake-normals": ("Normals", "normal"), "bake-ao": ("Ambient Occlusion", "ao")}

# What Toolbag runs. It has no Python of its own besides, so this imports nothing but `mset`.
SCRIPT = """\
import mset

job = {job}
mset.newScene()
baker = mset.BakerObject()
group = baker.addGroup("bench")
for name, path in (("High", job["high_obj"]), ("Low", job["low"])):
    mset.importModel(path).parent = group.findInChildren(name)
target = group.findInChildren("Low")
target.minOffset = target.maxOffset = job["distance"]
baker.outputPath = job["path"]
baker.outputWidth = baker.outputHeight = job["size"]
baker.outputSamples = job["samples"]
baker.outputBits = 16
baker.edgePadding, baker.edgePaddingSize = "Custom", job["padding"]
baker.outputSoften = 0.0
baker.smoothCage = True
baker.ignoreBackfaces = True
for item in baker.getAllMaps():
    item.enabled = False
item = baker.getMap(job["map"])
item.enabled, item.suffix = True, job["suffix"]
if "rays" in job:
    item.rayCount = job["rays"]
baker.bake()
mset.quit()
"""


def written(job, stem):
    """Write the script of a job; return its path and that of the map, None for other tasks."""
    if job["task"] not in MAPS:
        return None
    name, suffix = MAPS[job["task"]]
    path = stem.with_suffix(".py")
    given = {**job, "path": stem.with_suffix(".png").as_posix(), "map": name, "suffix": suffix}
    path.write_text(SCRIPT.replace("{job}", repr(given)), "utf-8")
    return path, stem.with_name(f"{stem.name}_{suffix}.png")


def main():
    """Do the jobs."""
    options = parser(__doc__)
    options.add_argument("--toolbag", default="toolbag.exe", help="path of the program")
    options.add_argument("--toolbag-version", default="5", help="its version, for the result file")
    chosen = options.parse_args()

    def command_of(job, stem):
        found = written(job, stem)
        form = "tangent" if job["task"] == "bake-normals" else None
        return found and ([chosen.toolbag, found[0]], found[1], form)

    do_jobs(chosen, "Toolbag", chosen.toolbag_version, command_of)


if __name__ == "__main__":
    main()
