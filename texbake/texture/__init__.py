"""Values over texture coordinates: images, their coding and their lookup."""
