#!/usr/bin/env bash
# The job step by step on the command line.
#
#     bash command_line.sh [FOLDER] [TRIANGLES]
set -euo pipefail
folder=${1:-command_line_sample}
triangles=${2:-1000000}

# A high-poly mesh: the demo writes its orange beside the results.
texbake demo -o "$folder" --triangles "$triangles" --size 512 --quiet > "$folder.log"
rm "$folder.log"
high="$folder/orange_high.ply"

# What is in it?
texbake info "$high"

# A low-poly mesh; --quality best takes longer and stays closer.
texbake simplify "$high" -o "$folder/low.obj" --faces 800

# Texture coordinates for maps of 1024 texels with 4 texels of padding, and a picture of the charts.
texbake unwrap "$folder/low.obj" -o "$folder/low_uv.obj" \
    --size 1024 --padding 4 --layout "$folder/layout.png" --report "$folder/unwrap.json"

# Both maps from the same rays, 4 per texel. If more than 1 % of the texels missed, this would fail.
texbake bake "$high" "$folder/low_uv.obj" -o "$folder/maps" --maps normal,displacement \
    --size 1024 --samples 4 --padding 4 --fail-on-miss 1 --report "$folder/bake.json"

# A normal map for a DirectX engine, 8 bits per channel.
texbake bake-normals "$high" "$folder/low_uv.obj" -o "$folder/normal_directx.png" \
    --size 1024 --padding 4 --convention directx --bits 8

# A picture, and how close the result comes to the high-poly mesh.
texbake preview "$folder/low_uv.obj" --normal-map "$folder/maps/normal.png" \
    --size 800x600 --view 30,30 -o "$folder/preview.png"
texbake compare "$high" "$folder/low_uv.obj" --normal-map "$folder/maps/normal.png" \
    -o "$folder/compare.png"
