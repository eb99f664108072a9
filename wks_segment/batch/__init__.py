"""Many files, each a job of its own in a child process; on one machine or many. Knows no Blender, nor imports it.

The children run the command line of `wks_segment.blender`, which is all that this room knows of it.
"""

from .batch_run import Batch, merged
from .errors import BatchError
from .inputs import inputs_of, names_of
from .job import Job, Outcome, content_of, key_of
from .limits import Limits
from .worker_main import Answer, serve
from .worker_process import COMMAND, Program, python_program

__all__ = [
    "COMMAND",
    "Answer",
    "Batch",
    "BatchError",
    "Job",
    "Limits",
    "Outcome",
    "Program",
    "content_of",
    "inputs_of",
    "key_of",
    "merged",
    "names_of",
    "python_program",
    "serve",
]
