"""The bench: what accuracy costs in time and memory, in texbake and in other programs."""
