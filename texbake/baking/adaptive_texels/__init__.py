"""Adaptive samples of a bake: one ray per texel, and more only where neighboring samples disagree.

`samples` runs all of it: `texel_sampler` casts the first sample of each texel, `texel_error`
adds samples until a bound on the error is kept, and `texel_rounds` does so for ever closer bounds
until a time is spent.
"""
