"""What all commands share: a user's mistake ends in one message and exit code 2."""

import sys
from collections.abc import Callable

from most.errors import MostError


def run(task: Callable[[], None]) -> None:
    """Run a command's work."""
    try:
        task()
    except MostError as error:
        print(f"most: {error}", file=sys.stderr)
        sys.exit(2)
