"""Every key of a scene file, where it has no effect: the same bytes, no file opened, nothing run.

The keys are those of the JSON Schema, so that a new one fails here until it has a value. Each is
put where it has no effect: beside a strength of 0, on an object outside the picture, in a dark
lamp. Every file that it names is damaged, so that opening one, even for its size, is an error.
"""

import re
from functools import cache

import pytest

from texbake import MakeOptions, TexbakeError, read_scene
from texbake.mapping.options import METHODS
from texbake.rendering.draw import draw, prepare
from texbake.rendering.scene.file.schema import TABLES
from texbake.rendering.scene.file.tables import types_of_fields
from texbake.rendering.scene.scene import camera_of

IMAGE, MOVE = '"damaged.png"', "[1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"
TEXTURE = f"texture = {IMAGE}"
HEAD = """
[camera]
position = [0.5, 1, 6]
target = [0, 0, 0]
near = 0.01
[render]
width = 24
height = 16
supersampling = 1
"""
SUN = '[[lights]]\nname = "sun"\nkind = "directional"\ndirection = [-0.3, -0.6, -1]\n'
AMBIENT = "[ambient]\ncolor = [0.2, 0.3, 0.4]\n"
BALL = '[[objects]]\nname = "ball"\nshape = "sphere"\nresolution = [12, 6]\n'
LIT = f"{HEAD}{SUN}{AMBIENT}{BALL}"
# Behind the camera, so that its material has no effect.
BEHIND = f'{LIT}[[objects]]\nshape = "cube"\ntranslate = [0, 0, 30]\n'


def lit(material):
    return f"{LIT}material = {{{material}}}\n"


def masked(material):
    return lit(f'opacity = 0, alpha_mode = "mask"<<, {material}>>')


# Scenes in which keys of a table have no effect; KEY stands for the key. The text between << and >>
# is left out for the picture to compare with.
PLACES: dict[str, list[str]] = {
    "[render]": [f"{HEAD}<<KEY\n>>{SUN}{BALL}"],
    "[ambient]": [f'{HEAD}{SUN}<<[ambient]\nKEY\n>>{BALL}material = {{shading = "unlit"}}\n'],
    "[environment]": [
        f"{HEAD}{SUN}<<[environment]\nintensity = 0\nbackground = false\nKEY\n>>{BALL}",
        f"{HEAD}{SUN}<<[environment]\nbackground = false\nlighting = false\nKEY\n>>{BALL}",
    ],
    "[fog]": [f'{HEAD}{SUN}<<[fog]\nmode = "exp2"\ndensity = 0\nKEY\n>>{BALL}'],
    "[ambient_occlusion]": [
        f"{HEAD}{SUN}{AMBIENT}<<[ambient_occlusion]\nstrength = 0\nKEY\n>>{BALL}",
        f"{HEAD}{SUN}<<[ambient_occlusion]\nKEY\n>>{BALL}",
    ],
    "[[lights]]": [
        f'{HEAD}{SUN}<<[[lights]]\nname = "lamp"\nkind = "spot"\nposition = [0, 0, 5]\n'
        f"{dark}\nKEY\n>>{BALL}"
        for dark in ("intensity = 0", "direction = [0, 0, 1]", "color = [0, 0, 0]")
    ],
    "shadow": [
        f"{HEAD}{SUN}<<shadow = {{KEY}}\n>>{BALL}casts_shadows = false\n",
        f"{HEAD}{SUN}<<shadow = {{KEY}}\n>>{BALL}receives_shadows = false\n",
    ],
    "[[objects]]": [f"{BEHIND}<<KEY\n>>"],
    "mapping": [f"{LIT}<<mapping = {{METHOD, KEY}}\n>>"],
    "[materials.NAME]": [f"{BEHIND}<<material = {{KEY}}\n>>", masked("KEY")],
    "an image": [
        lit(f'shading = "unlit"<<, roughness = {{image = {IMAGE}, KEY}}>>'),
        lit(f'alpha_mode = "opaque"<<, opacity = {{image = {IMAGE}, KEY}}>>'),
        lit(f"<<emission = {{image = {IMAGE}, factor = 0, KEY}}>>"),
        lit(f'shading = "lambert"<<, specular = {{image = {IMAGE}, KEY}}>>'),
    ],
    "a procedure": [
        lit('shading = "unlit"<<, roughness = {procedure = "marble", KEY}>>'),
        lit('<<emission = {procedure = "marble", factor = 0, KEY}>>'),
    ],
    "a volume": [
        lit('shading = "unlit"<<, roughness = {volume = "damaged.npy", KEY}>>'),
        lit('<<emission = {volume = "damaged.npy", factor = 0, KEY}>>'),
    ],
    "normal_map": [
        lit(f"<<normal_map = {{{TEXTURE}, strength = 0, KEY}}>>"),
        lit(f'shading = "unlit"<<, normal_map = {{{TEXTURE}, KEY}}>>'),
        f"{HEAD}{AMBIENT}{BALL}<<material.normal_map = {{{TEXTURE}, KEY}}\n>>",
    ],
    "bump_map": [
        lit(f"<<bump_map = {{{TEXTURE}, height = 0, KEY}}>>"),
        lit(f'shading = "unlit"<<, bump_map = {{{TEXTURE}, KEY}}>>'),
    ],
    "displacement": [lit(f"<<displacement = {{{TEXTURE}, height = 0, KEY}}>>")],
    "parallax": [
        lit(f"<<parallax = {{{TEXTURE}, depth = 0, KEY}}>>"),
        lit(f"<<parallax = {{{TEXTURE}, KEY}}>>"),
    ],
    "reflection": [lit("<<reflection = {fresnel = false, strength = 0, KEY}>>"),
                   masked("reflection = {KEY}")],
    "refraction": [lit("<<refraction = {strength = 0, KEY}>>"), masked("refraction = {KEY}")],
    "transmission": [
        lit("<<transmission = {strength = 0, KEY}>>"),
        lit('shading = "lambert"<<, transmission = {KEY}>>'),
        lit("metalness = 1<<, transmission = {KEY}>>"),
        masked("transmission = {KEY}"),
    ],
    "projected": [
        lit(f"<<projected = [{{{TEXTURE}, position = [0, 0, 5], {aim}, KEY}}]>>")
        for aim in ("target = [0, 0, 0], strength = 0", "target = [0, 0, 9]", "target = [9, 0, 5]")
    ],
}  # fmt: skip
# Keys that always have an effect: they set the camera, the picture, or the surface itself.
ALWAYS: dict[str, set[str]] = {
    "the file": set(TABLES["the file"].model_fields),
    "[camera]": set(TABLES["[camera]"].model_fields),
    "[render]": set(TABLES["[render]"].model_fields)
    - {"filter", "bounces", "max_triangles", "back_faces"},
    "[[objects]]": {"mesh", "shape", "translate", "matrix", "level", "n_triangles",
                    *types_of_fields(MakeOptions)},
}  # fmt: skip
# Keys that exclude another key.
CONFLICTS = {"target": "direction", "direction": "target", "matrix": "position", "faces": "image"}
# Values of keys, with the table's name where tables need different ones.
VALUES: dict[str, str] = {
    "alpha_cutoff": "0.3", "alpha_mode": '"blend"', "angle": "30", "aspect": "2", "axis": '"x"',
    "attenuation_color": "[0.1, 0.5, 0.9]", "attenuation_distance": "0.5",
    "background": "false", "base_color": IMAGE, "blend": "0.5", "border": "0.5", "bump_map": IMAGE,
    "by_group": "true", "camera": "[10, 20]", "caps": "true", "casts_shadows": "true",
    "center": "[0, 0, 1]", "channel": '"g"', "charts": '"xatlas"', "color": "[0.9, 0.2, 0.1]",
    "colors": '["#000", "#fff"]', "convention": '"directx"', "decay": "1",
    "density": "0", "depth": "0", "difference": '"forward"', "direction": "[0, 0.1, 1]",
    "displacement": f"{{{TEXTURE}, height = 0}}", "double_sided": "true",
    "edge_px": "4", "emission": IMAGE, "end": "20", "environment": '"rendered"', "exponent": IMAGE,
    "eye": "[0, 0, 9]", "faces": f"[{', '.join(6 * [IMAGE])}]", "facing": "true", "factor": "0",
    "filter": '"ewa"', "filter_radius": "2", "filtered": "false", "fit": '"pca"', "flip": '"s"',
    "follows_camera": "true", "form": '"emboss"', "fov": "40", "fresnel": "true", "gate": '"round"',
    "gloss": IMAGE, "ground": "[0.1, 0, 0]", "height": "0", "image": IMAGE, "intensity": "0",
    "ior": "1.4", "keep": "true", "keep_seams": "true", "kind": '"spot"', "layers": "8",
    "light_map": IMAGE, "light_space": '"object"', "lighting": "false", "linear":
    "[2, 0, 0, 0, 2, 0]", "mapping": '"atlas"', "material": f"{{base_color = {IMAGE}}}",
    "matrix": MOVE, "max_stretch": "1.5", "metalness": IMAGE,
    "method": '"atlas"', "mid": "0.5", "mode": '"exp"',
    "name": '"a"', "normal": "[0, 1, 0]", "normal_map": IMAGE, "occlusion": IMAGE,
    "occlusion_strength": "0.5", "offset": "[0.1, 0.2]", "only": '"a"', "opacity": IMAGE,
    "overlap": "true", "padding": "2", "parallax": IMAGE,
    "position": "[0, 0, 5]", "procedure": '"marble"', "profile": IMAGE, "projected":
    f"[{{{TEXTURE}, position = [0, 0, 5], target = [0, 0, 0]}}]", "quality": '"best"',
    "radius": "2", "range": "[0, 2]", "receives_shadows": "false",
    "reflection": f"{{strength = {IMAGE}}}", "refraction": f"{{strength = {IMAGE}}}",
    "rotate": "30",
    "roughness": IMAGE, "samples": "8", "scale": "2", "seam_angle": "60", "symmetry": '"off"',
    "hide_seams": "0.2", "straighten": "true",
    "seams_at_hard_edges": "true", "shading": '"unlit"', "shading_rate": '"vertex"',
    "shadow": "true", "sides": "6", "size": "32", "space": '"object"',
    "specular": IMAGE, "start": "1", "static": "false", "strength": "0", "surface": '"sphere"',
    "target": "[0, 0, 9]", "texel_density": "10", "texture": IMAGE, "theta": "[0, 90]",
    "thickness": IMAGE, "tiles": "2", "timeout": "9", "transmission": f"{{strength = {IMAGE}}}",
    "unseen": '"project"', "up": "[0, 1, 0.1]", "uv_set": '"nowhere"', "vector": "true",
    "vertex_colors": "true", "via": '"centroid"', "visible": "false", "volume": '"damaged.npy"',
    "warp": '"twirl"', "wrap": '"mirror"',
    "back_faces": '"show"', "bounces": "2", "max_triangles": "1000",
    "a procedure scale": "2", "projected aspect": "1.5",
    "mapping rotate": "30", "mapping center": "[0, 0, 1]", "[[objects]] rotate": "[0, 30, 0]",
    "mapping scale": "[2, 2]", "a volume offset": "[0.1, 0, 0]", "a volume filter": '"nearest"',
    "mapping camera": "[10, 20]", "mapping height": "[0, 1]", "projected occlusion": "true",
    "projected strength": "0", "normal_map space": '"world"', "refraction ior": "1.2",
    "shadow size": "32", "mapping size": "64",
    "mapping sides": "true",
    "an image color": "true", "an image offset": "[1, 1]",
    "[ambient_occlusion] radius": "2", "an image colors": '["#000", "#fff"]',
}  # fmt: skip


def method_of(key):
    if key in ("surface", "via", "eye"):
        return 'method = "two-part", via = "reflection", eye = [0, 0, 9]'
    if key in ("fov", "unseen"):
        return 'method = "projector", camera = [10, 20]'
    if key == "timeout":
        return 'method = "atlas", charts = "xatlas"'
    methods = [name for name, method in METHODS.items() if key in method.options]
    return f'method = "{(methods or ["spherical"])[0]}"'


def cases():
    """Table, key, the scene without the key, and the scene with it."""
    for table, model in TABLES.items():
        for key in set(model.model_fields) - ALWAYS.get(table, set()):
            for place in PLACES[table]:
                before, middle, after = re.fullmatch(r"(.*)<<(.*)>>(.*)", place, re.DOTALL).groups()
                middle = middle.replace("METHOD", method_of(key))
                has = re.search(rf"\b{key} =", middle)
                is_beside = re.search(rf"\b{key} =", before.rpartition("\n")[2])
                if is_beside or f"{CONFLICTS.get(key)} =" in middle:
                    continue
                value = VALUES.get(f"{table} {key}") or VALUES[key]
                said = "" if has else f"{key} = {value}"
                middle = middle.replace("KEY", said) if said else re.sub("(, |)KEY", "", middle)
                yield table, key, before + after, before + middle + after


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("scenes")
    for name in "damaged.png", "damaged.npy":
        (place / name).write_bytes(b"neither an image nor a volume")
    return place


@cache
def picture_of(folder, text):
    """Pixels, passes with what each is for, and those that ran."""
    (folder / "scene.toml").write_text(text)
    scene = read_scene(folder / "scene.toml")
    frame = draw(prepare(scene, threads=1), camera_of(scene, scene.options()))
    plan = {(item.name, str(target)) for item in frame.plan.passes for target in item.targets}
    ran = {name for name, cost in frame.costs.by_name.items() if not cost.skipped}
    return frame.color.tobytes(), plan, ran


def test_every_key_of_the_schema_has_a_place_without_effect():
    found = {(table, key) for table, key, _, _ in cases()}
    expected = {
        (table, key)
        for table, model in TABLES.items()
        for key in set(model.model_fields) - ALWAYS.get(table, set())
    }
    assert expected - found == {("projected", "matrix")}


@pytest.mark.parametrize("table", PLACES)
def test_a_key_without_effect_costs_nothing(table, folder):
    wrong = []
    for _, key, bare, text in filter(lambda case: case[0] == table, cases()):
        try:
            expected, found = picture_of(folder, bare), picture_of(folder, text)
        except TexbakeError as error:
            wrong.append(f"{key}: {error}\n{text}")
            continue
        for i, what in enumerate(("pixels", "plan", "passes that ran")):
            if found[i] != expected[i]:
                more = "" if i == 0 else f" {set(found[i]) ^ set(expected[i])}"
                wrong.append(f"{key}: other {what}{more}\n{text}")
    assert not wrong, "\n".join(wrong)
