"""The error that a user reads."""


class UserError(Exception):
    """Something in the input that the user can mend; the message names it and says how."""


class TooLargeError(UserError):
    """A job is larger than the user's limit; the message gives its estimate."""
