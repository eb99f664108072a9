"""Batches: the command line for many files, each a job in a child process, on one machine or many.

Knows nothing of Blender and does not import it: the children run the command line of `wks_segment.blender`.
"""

from .batch_run import Batch, merge_logs
from .child_main import Answer, serve
from .child_process import CHILD_COMMAND, Program, python_program
from .errors import BatchError
from .inputs import find_inputs, result_names
from .job import Job, Outcome, hash_models, job_key
from .limits import Limits

__all__ = [
    "CHILD_COMMAND",
    "Answer",
    "Batch",
    "BatchError",
    "Job",
    "Limits",
    "Outcome",
    "Program",
    "find_inputs",
    "hash_models",
    "job_key",
    "merge_logs",
    "python_program",
    "result_names",
    "serve",
]
