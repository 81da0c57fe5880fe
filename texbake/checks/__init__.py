"""The preflight: what will go wrong in a bake, named before it does."""
