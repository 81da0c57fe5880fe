"""Colors baked into a mesh's own atlas: solid procedures, and photographs cast onto it."""
