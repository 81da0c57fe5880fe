"""The compiled loops of this room, one algorithm to a file; the modules that call them check."""
