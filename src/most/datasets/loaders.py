"""Processes that read ahead."""

import multiprocessing


def start_method(workers: int) -> str | None:
    """Return how loader processes are started: the platform's way, where there are any.

    joblib's processes have a way of their own by default, which can start no loaders.
    """
    return multiprocessing.get_all_start_methods()[0] if workers else None
