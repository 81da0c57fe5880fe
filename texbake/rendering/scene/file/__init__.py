"""Scene files: TOML that is validated key by key and becomes a `Scene`."""
