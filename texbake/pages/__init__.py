"""HTML reports: each page is a single file that works offline.

- `asset_page`: the page of one asset. `write_bake_page` writes it for a bake with `page_options`;
  `write_asset_page` writes it from an `AssetPage`, as `run` and `compare` do. It has a 3D view of
  the high-poly, the low-poly and the baked mesh, with a slider between two of them; the maps, with
  the UV layout and the missed rays as overlays; distances, errors, times and the command.
- `build_page`: all assets of a build in a sortable table, one `BuildRow` each, with thumbnails.

The Jinja templates are in `templates`; style sheets, scripts and three.js are in `assets`.
"""
