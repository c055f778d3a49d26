"""What all commands share: what a user can put right ends in one message, and a mistake in exit code 2."""

import sys
from collections.abc import Callable

from most.errors import MostError


def run(task: Callable[[], None]) -> None:
    """Run a command's work."""
    try:
        task()
    except MostError as error:
        print(f"most: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
