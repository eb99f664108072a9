"""Errors that end a batch."""


class BatchError(Exception):
    """The batch as a whole cannot be run; the message says why, and what the user can do."""


class BatchEndedError(Exception):
    """The user ended the batch while a job was running."""
