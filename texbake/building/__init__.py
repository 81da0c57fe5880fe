"""Many assets through the steps of a pipeline file: what changed runs again, and nothing else."""
