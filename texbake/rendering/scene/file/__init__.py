"""Scene files: TOML, checked key by key, to a `Scene`."""
