"""What times of scans must be: seconds, each later than the one before."""

from pathlib import Path

from jaxtyping import Float64
from torch import Tensor

from most.datasets.pose_files import numbered_rows
from most.errors import DataError

LONGEST_STEP = 60.0  # s between two scans of a drive; what is further apart was counted in another unit


def check_times(file: Path, times: Float64[Tensor, "scans"]) -> None:
    """Raise a DataError that names the file, and the line at fault, unless these are seconds that grow.

    In other units no object would be followed: every track would be lost from one scan to the next.
    """
    steps = times.diff()
    if late := (steps <= 0).nonzero().flatten().tolist():
        before, after = times[late[0] : late[0] + 2].tolist()
        raise DataError(
            f"{file}, line {numbered_rows(file)[late[0] + 1][0]} (scan {late[0] + 1}, from 0): expected a time after "
            f"{before:.15g} s, found {after:.15g} s; give each scan its own time, in seconds"
        )
    if len(steps) and (usual := float(steps.median())) > LONGEST_STEP:
        raise DataError(
            f"{file}: expected seconds, found steps of {usual:.15g} from scan to scan; if these are nanoseconds, "
            "divide them by 1e9 (microseconds by 1e6, milliseconds by 1e3)"
        )
