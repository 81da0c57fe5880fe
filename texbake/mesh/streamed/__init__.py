"""A mesh that stays in its file and is read in chunks, as often as it is needed."""
