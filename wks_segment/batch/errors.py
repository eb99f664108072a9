"""Errors that end a batch."""


class BatchError(Exception):
    """The batch as a whole cannot be run; the message says why, and what the user can do."""


class DiskFullError(BatchError):
    """No result can be written any more, so that every further file would fail."""


def disk_full_error(reason: str) -> DiskFullError:
    """The error of a full disk, with what to do."""
    return DiskFullError(f"{reason}: make room on the disk, then continue with the same command and --resume")


class BatchEndedError(Exception):
    """The user ended the batch while a job was running."""
