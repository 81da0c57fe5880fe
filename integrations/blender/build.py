# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension: one zip file for each platform, from the wheels of texbake.

    make extension
    python integrations/blender/build.py dist/*.whl -o dist

Blender installs `texbake-VERSION-PLATFORM.zip` with Preferences > Get Extensions > Install from
Disk. The zip of a platform has the wheel of that platform alone.
"""

import argparse
import json
import re
import sys
import zipfile
from pathlib import Path

FOLDER = Path(__file__).parent
# The files of the extension.
OTHERS = ("build.py", "measure.py")
FILES = ("LICENSE", *sorted(p.name for p in FOLDER.glob("*.py") if p.name not in OTHERS))
# Blender's names of platforms, by what tags of wheels match.
PLATFORMS = {
    r"(many)?linux.*_x86_64": "linux-x64",
    r"(many)?linux.*_aarch64": "linux-arm64",
    r"macosx_.*_arm64": "macos-arm64",
    r"macosx_.*_x86_64": "macos-x64",
    r"win_amd64": "windows-x64",
}


def platform_of(wheel: Path) -> str:
    """Return Blender's name of the platform that a wheel is for."""
    tag = wheel.stem.split("-")[-1]
    for pattern, platform in PLATFORMS.items():
        if re.fullmatch(pattern, tag):
            return platform
    raise SystemExit(f"{wheel}: its platform {tag} is not one of {', '.join(PLATFORMS.values())}")


def manifest_for(wheel: Path) -> str:
    """Return the manifest of the extension with a wheel."""
    fields = {
        "version": wheel.name.split("-")[1],
        "platforms": [platform_of(wheel)],
        "wheels": [f"./wheels/{wheel.name}"],
    }
    added = "".join(f"{name} = {json.dumps(value)}\n" for name, value in fields.items())
    return added + (FOLDER / "blender_manifest.toml").read_text(encoding="utf-8")


def build(wheel: Path, folder: Path) -> Path:
    """Write the extension with a wheel into a folder; return its path."""
    version = wheel.name.split("-")[1]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"texbake-{version}-{platform_of(wheel)}.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("blender_manifest.toml", manifest_for(wheel))
        for name in FILES:
            archive.write(FOLDER / name, name)
        archive.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)
    return path


def main(arguments: list[str]) -> None:
    """Build one extension for each of the wheels."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", nargs="+", type=Path, metavar="WHEEL")
    parser.add_argument("-o", "--output", type=Path, default=Path("dist"), metavar="FOLDER")
    chosen = parser.parse_args(arguments)
    for wheel in chosen.wheels:
        print(build(wheel, chosen.output))


if __name__ == "__main__":
    main(sys.argv[1:])
