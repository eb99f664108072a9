"""What a user reads when a batch cannot begin or go on."""


class BatchError(Exception):
    """A batch as a whole cannot be run; the message names what is wrong and says what to do."""


class EndedError(Exception):
    """A batch was ended by the user while a job was at work."""
