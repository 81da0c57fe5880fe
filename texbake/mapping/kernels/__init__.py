"""The compiled loops of the mappings: each file is named after its algorithm."""
