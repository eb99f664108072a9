"""The error that a user reads."""


class UserError(Exception):
    """Something in the input that the user can mend; the message names it and says how."""


class TooLargeError(UserError):
    """A job is larger than the user's limit; the message gives its estimate."""


class ChangedError(UserError):
    """What was read is no longer as it was; the message says what happened to it."""


class EndedError(UserError):
    """A job was ended before it was done; the message says why."""
