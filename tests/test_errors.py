"""Messages that several places share."""

import pytest

from most.errors import DataError, check_entries


def test_a_file_has_as_many_entries_as_its_scan_has_points():
    check_entries("a.label", 0, 0)
    with pytest.raises(
        DataError, match=r"^a\.label: expected a label for each of the scan's 3 points, found 2; .*copy"
    ):
        check_entries("a.label", 2, 3)
    with pytest.raises(DataError, match=r"^b\.npz: expected an entry for each of the truth's 2 points, found 3; "):
        check_entries("b.npz", 3, 2, "an entry", "truth")
