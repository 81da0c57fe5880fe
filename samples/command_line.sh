#!/usr/bin/env bash
# The job step by step on the command line.
#
#     bash command_line.sh [FOLDER] [TRIANGLES]
set -euo pipefail
folder=${1:-command_line_sample}
triangles=${2:-1000000}

# A dense mesh to work on: the demo leaves its orange there, beside what it made of it.
texbake demo -o "$folder" --triangles "$triangles" --size 512 --quiet > "$folder.log"
rm "$folder.log"
high="$folder/orange_high.ply"

# What is in it?
texbake info "$high"

# Lighter, by quadric error; --quality best takes longer and lies closer.
texbake simplify "$high" -o "$folder/light.obj" --faces 800

# Texture coordinates, packed for a map of 1024 texels with 4 around each chart; a picture of them.
texbake unwrap "$folder/light.obj" -o "$folder/light_uv.obj" \
    --size 1024 --padding 4 --layout "$folder/layout.png" --report "$folder/unwrap.json"

# Both maps from one trace, with 4 rays a texel. More than 1 % of missed texels would be an error.
texbake bake "$high" "$folder/light_uv.obj" -o "$folder/maps" --maps normal,displacement \
    --size 1024 --samples 4 --padding 4 --fail-on-miss 1 --report "$folder/bake.json"

# A normal map for a DirectX engine, in 8 bits.
texbake bake-normals "$high" "$folder/light_uv.obj" -o "$folder/normal_directx.png" \
    --size 1024 --padding 4 --convention directx --bits 8

# Look at it, and ask how close it comes.
texbake preview "$folder/light_uv.obj" --normal-map "$folder/maps/normal.png" \
    --size 800x600 --view 30,30 -o "$folder/preview.png"
texbake compare "$high" "$folder/light_uv.obj" --normal-map "$folder/maps/normal.png" \
    -o "$folder/compare.png"
