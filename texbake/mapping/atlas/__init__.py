"""Atlases: charts are cut, flattened, joined and packed, for any mesh."""
