"""The classical mappings: closed formulas from a position or a normal to (s, t)."""
