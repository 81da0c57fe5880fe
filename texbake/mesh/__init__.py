"""A mesh: what it is, where it comes from, how it is made lighter."""
