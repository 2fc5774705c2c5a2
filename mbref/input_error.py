"""The exception of a refused argument or option."""

from __future__ import annotations


class InputError(ValueError):
    """An argument, an option or a file that is refused.

    The message names it and says what is expected. The command line prints the message alone; every other
    ValueError is a defect of the program and keeps its traceback.
    """
