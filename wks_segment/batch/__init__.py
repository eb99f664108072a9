"""Many files, each a job of its own in a child process; on one machine or many. Knows no Blender, nor imports it.

The children run the command line of `wks_segment.blender`, which is all that this room knows of it.
"""

from .errors import BatchError
from .inputs import inputs_of, names_of
from .job import Job, Outcome
from .limits import Limits
from .run import Batch

__all__ = ["Batch", "BatchError", "Job", "Limits", "Outcome", "inputs_of", "names_of"]
