"""Scripts that do one job in a process of their own: `run_*.py` with a job as JSON.

Each is run by the Python in which its program is installed, so they import nothing of texbake. A
job names its `task`, its files and its settings. The task `version` prints the program's version.
"""
