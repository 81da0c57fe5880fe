"""Bench xNormal 3.19.3, which runs on Windows only, by the XML files of its batch mode.

    python integrations/bench/xnormal.py cases --xnormal "C:/Program Files/xNormal/x64/xNormal.exe"

Nobody has run this yet: it follows the files that xNormal itself saves. `--dry-run` writes them
and starts nothing.
"""

from xml.etree import ElementTree

from adapter import do_jobs, parser

# What xNormal appends to the name of a map, and the attributes that ask for it.
MAPS = {
    "bake-normals": ("normals", ".tif", {"GenNormals": True}),
    "bake-displacement": ("heights", ".exr", {"GenHeights": True, "HeightTonemap": "RawFPValues"}),
    "bake-ao": ("occlusion", ".exr", {"GenAO": True, "AODistribution": "Cosine"}),
}
FORMS = {"bake-normals": "tangent", "bake-displacement": "heights"}
EVERY_MAP = ("Normals", "Heights", "AO", "Bent", "PRT", "Convexity", "Thickness", "Proximity",
             "Cavity", "WireRays", "Directions", "RadiosityNormals", "Curv", "DerivNM",
             "Translu")  # fmt: skip
AA = {1: "1", 4: "2", 16: "4"}  # samples along one side of a texel


def settings_of(job, path):
    """Return the settings of a bake as the tree of an XML file; `path` names the map."""
    _, _, asked = MAPS[job["task"]]
    normals = "UseExportedNormals" if job["has_normals"] else "AverageNormals"
    swizzle = {f"Swizzle{axis}": f"{axis}+" for axis in "XYZ"}  # OpenGL
    root = ElementTree.Element("Settings", Version="3.19.3")
    high = ElementTree.SubElement(root, "HighPolyModel", DefaultMeshScale="1.000000")
    add(high, "Mesh", Visible=True, Scale=1.0, File=job["high_obj"], AverageNormals=normals)
    low = ElementTree.SubElement(root, "LowPolyModel", DefaultMeshScale="1.000000")
    add(
        low, "Mesh", Visible=True, Scale=1.0, File=job["low"], AverageNormals="AverageNormals",
        MaxRayDistanceFront=job["distance"], MaxRayDistanceBack=job["distance"], UseCage=False,
        NormapMapType="Tangent-space", BackfaceCull=True,
        **{f"NM{key}": value for key, value in swizzle.items()},
    )  # fmt: skip
    maps = {f"Gen{name}": False for name in EVERY_MAP} | asked
    add(
        root, "GenerateMaps", File=path, Width=job["size"], Height=job["size"],
        EdgePadding=job["padding"], BucketSize=64, TangentSpace=True, ClosestIfFails=False,
        DiscardRayBackFacesHits=True, AA=AA[job["samples"]], AORaysPerSample=job.get("rays", 64),
        AOConeAngle=180.0, AOAllowPureOccluded=True, AOLimitRayDistance=False, **swizzle, **maps,
    )  # fmt: skip
    return ElementTree.ElementTree(root)


def add(parent, tag, **attributes):
    """Add an element; xNormal writes true and false in lower case, and six digits."""
    texts = {
        key: str(value).lower() if isinstance(value, bool)
        else f"{value:.6f}" if isinstance(value, float)
        else str(value)
        for key, value in attributes.items()
    }  # fmt: skip
    ElementTree.SubElement(parent, tag, texts)


def written(job, stem):
    """Write the XML file of a job; return its path and that of the map, None for other tasks."""
    if job["task"] not in MAPS:
        return None
    name, suffix, _ = MAPS[job["task"]]
    path = stem.with_suffix(".xml")
    tree = settings_of(job, stem.with_suffix(suffix))
    tree.write(path, encoding="UTF-8", xml_declaration=True)
    return path, stem.with_name(f"{stem.name}_{name}{suffix}")


def main():
    """Do the jobs."""
    options = parser(__doc__)
    options.add_argument("--xnormal", default="xNormal.exe", help="path of the program")
    chosen = options.parse_args()

    def command_of(job, stem):
        found = written(job, stem)
        return found and ([chosen.xnormal, found[0]], found[1], FORMS.get(job["task"]))

    do_jobs(chosen, "xNormal", "3.19.3", command_of)


if __name__ == "__main__":
    main()
