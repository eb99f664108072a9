"""The error that a user reads."""


class UserError(Exception):
    """Something in the input that the user can mend; the message names it and says how."""
