"""Adaptive sampling of a picture: few samples per pixel, and more where they disagree.

`samples` refines a picture until its estimated error is below a bound, or for ever closer bounds
until a time is spent. `sampler` keeps the samples of pixels for later rounds.
"""
