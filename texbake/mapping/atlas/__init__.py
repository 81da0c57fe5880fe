"""Charts cut, flattened, joined and packed: texture coordinates for any mesh."""
