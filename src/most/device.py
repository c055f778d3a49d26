"""Where a model runs."""

import torch

from most.errors import ConfigError


def chosen_device(name: str) -> torch.device:
    """Return the device of this name, for ``auto`` a GPU where there is one; a ConfigError where it is not there."""
    there = torch.cuda.is_available()
    gpus = ["cuda", *(f"cuda:{number}" for number in range(torch.cuda.device_count()))] if there else []
    if name not in ("auto", "cpu", *gpus):
        raise ConfigError(f"device: expected auto, cpu, or cuda where there is a GPU, found {name}")
    automatic = "cuda" if there else "cpu"
    return torch.device(automatic if name == "auto" else name)
