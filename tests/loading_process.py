"""Errors of loading processes."""

from torch._utils import ExceptionWrapper


def from_a_loading_process(error):
    """As torch keeps an error of a loading process, until the training's own process raises it."""
    try:
        raise error
    except Exception:
        return ExceptionWrapper(where="in DataLoader worker process 0")
