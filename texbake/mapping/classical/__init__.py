"""The classical mappings: closed formulas from a position or normal to (s, t)."""
