"""Charts into textures, as large as they fit."""
