"""Pages for people: one HTML file each, which needs no network and asks for none.

- `bake_page.write_bake_page(path, high, low, baked, ...)`: one asset, from a bake with
  `page_maps.page_options`; and `asset_page.write_asset_page(path, AssetPage(...))`, the same from
  whatever is there, as `run` and `compare` call it. A view of the dense, the bare and the baked
  light mesh with a slider between them, maps with zoom to the texel, the layout and missed rays
  over them, distances, errors, times and the command.
- `build_page.write_build_page(path, rows, *, title, command, seconds)`: all assets of a build, one
  `build_page.BuildRow` each, sortable, with thumbnails that `build_page.thumbnail(picture)` makes.

Pages hold three.js as trimesh brings it; it is read from there when a page is written.
"""
