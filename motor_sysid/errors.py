"""The one exception that is meant for people: bad input, said so that it can be mended."""


class UserError(Exception):
    """Input that cannot be used; the message names the value, its unit, the range and the remedy.

    The command line prints it as ``error: ...`` and exits with code 2; nodes log it and stop.
    """
