"""What the runners share: the job, as the JSON text on their command line."""

import json
import sys


def do_job(tasks):
    """Call the function that the job names, one of `tasks`, with the job."""
    job = json.loads(sys.argv[1])
    tasks[job["task"].replace("-", "_")](job)
