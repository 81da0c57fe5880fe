"""Adaptive sampling: what bakes and pictures share of it.

A user gives a bound on the error (`bounds`) or a time, which is spent in rounds to ever closer
bounds (`rounds`). Samples are added until the estimated error of each texel or pixel is within
the bound, in `texbake.baking.adaptive_texels` and `texbake.rendering.adaptive_pixels`. At the end
some of them are sampled again, and everything is reported (`report`).
"""
