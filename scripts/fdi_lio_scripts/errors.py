"""Errors that a user can mend, and the one place where they become a message and an exit code."""

import sys
from pathlib import Path
from typing import Callable

EXIT_USER_ERROR = 2  # the code that argparse uses for a wrong command line
EXIT_INTERRUPTED = 130  # what a shell reports after Ctrl-C


class UserError(Exception):
    """Says what is wrong, where, and what to do about it, in one line."""


def write_text(path: str, text: str) -> None:
    """Writes a whole file; a full disk is an error that names it, which that of the system does not."""
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}: check the path, its rights and the free space") from None


def run(main: Callable[[], int]) -> None:
    """Runs `main` and ends the process: with its return code, or with a one-line message and code 2."""
    try:
        code = main()
        sys.stdout.flush()
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        code = EXIT_USER_ERROR
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        what = error.strerror or error
        print(f"error: {where}{what}: check the path, its rights and the free space", file=sys.stderr)
        code = EXIT_USER_ERROR
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        code = EXIT_INTERRUPTED
    sys.exit(code)
