"""The root of every error a user may meet. The command line prints these as one line, without a traceback."""


class PushlaneError(Exception):
    """Something the user can mend: the message names the value and what was expected."""

    exit_code = 2
