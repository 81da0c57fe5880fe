"""Pages for people: one HTML file each, which needs no network.

- `asset_page`: one asset. `write_bake_page` writes it for a bake that was made with `page_options`;
  `write_asset_page` writes it from whatever an `AssetPage` holds, as `run` and `compare` do. It has
  a 3D view of the high-poly, the low-poly and the baked mesh with a slider between two of them;
  maps with zoom to the texel, under the UV layout and the missed rays; distances, errors, times and
  the command.
- `build_page`: all assets of a build in one sortable table, one `BuildRow` each, with thumbnails.

The HTML is in `templates`, as Jinja templates; style sheets, scripts and three.js are in `assets`.
"""
