"""What all commands share: what a user can put right ends in one message, and a mistake in exit code 2.

Stopped with Ctrl-C, a command ends in one line, too.
"""

import errno
import os
import signal
import sys
from collections.abc import Callable, Collection
from typing import NoReturn

from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from most.errors import ConfigError, MostError, said
from most.keys import is_of

KEY_ERRORS = (ConfigAttributeError, ConfigKeyError)
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NO_RIGHT = (errno.EROFS, errno.EACCES, errno.EPERM)
NO_PLACE = (errno.EISDIR, errno.ENOTDIR, errno.EEXIST)  # a folder where a file is to be, or a file on the way

INTERRUPTED = 128 + signal.SIGINT


def start(main: Callable[[], None]) -> None:
    """Run a command's main function: a configuration that does not compose is a mistake as well.

    The command's own work goes through ``run`` inside it, before Hydra can add lines of its own to a message.
    """
    os.environ.setdefault("HYDRA_FULL_ERROR", "1")  # else Hydra shortens every error, those of the program too
    try:
        run(main)
    except (HydraException, OmegaConfBaseException) as error:
        lines = str(error).split("Config search path:")[0].splitlines()  # what follows is of use to developers alone
        end("\n".join([*filter(_helps, lines), *_cause(error)]), 2)


def _helps(line: str) -> bool:
    """Whether a line of Hydra's is of use: of what can be appended, experiments alone are not there already."""
    return "+experiment=" in line or not (line.startswith("To append") or line.endswith("_schema"))


def _cause(error: Exception) -> list[str]:
    """Say why a configuration did not compose; where a key does not exist, which ones do."""
    cause = error.__cause__
    parent = getattr(cause, "parent_node", None)
    keys = sorted(map(str, parent)) if isinstance(cause, KEY_ERRORS) and isinstance(parent, DictConfig) else []
    known = [f"expected one of {', '.join(keys)}"] if keys else []
    return [*str(cause).splitlines()[:1], *known] if cause else known


def run(task: Callable[[], object], goes_on: bool = False) -> None:
    """Run a command's work; ``goes_on``: given again after an interruption, the command takes up what it left."""
    try:
        task()
    except KeyboardInterrupt:
        end("stopped; the same command goes on" if goes_on else "stopped", INTERRUPTED)
    except MostError as error:
        end(said(error), error.exit_code)
    except OSError as error:
        advice = {**dict.fromkeys(NO_ROOM, "make room"), **dict.fromkeys(NO_RIGHT + NO_PLACE, "choose another place")}
        if error.errno not in advice:
            raise
        place = error.filename or "an output file"
        end(f"{place}: expected to read or write it, found {error.strerror}; {advice[error.errno]}", 2)


def refuse_idle(keys: Collection[str], why: str) -> None:
    """Refuse settings under these keys that the user gave, though they cannot act; defaults are no mistake.

    ``why`` goes on the sentence "expected none". Without Hydra nothing was given.
    """
    told = HydraConfig.get().overrides.task if HydraConfig.initialized() else []
    for override in OverridesParser.create().parse_overrides(list(told)):
        key = override.key_or_group
        if is_of(key, keys):
            raise ConfigError(f"{key}: expected none {why}, found {override.input_line}; leave it out")


def end(message: str, code: int) -> NoReturn:
    """Say what is wrong, and end this process."""
    print(f"most: {message}", file=sys.stderr)
    sys.exit(code)
