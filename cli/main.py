"""The `texbake` command."""
