"""A user's mistake is one message and exit code 2; a mistake of ours keeps its traceback."""

import pytest

from most.entry import run
from most.errors import ConfigError, DataError, MostError


def failing(error):
    def task():
        raise error

    return task


@pytest.mark.parametrize("kind", [MostError, ConfigError, DataError])
def test_a_users_mistake_is_its_message_alone(kind, capsys):
    with pytest.raises(SystemExit) as stop:
        run(failing(kind("scan.bin: expected points, found none")))
    assert stop.value.code == 2
    assert capsys.readouterr() == ("", "most: scan.bin: expected points, found none\n")


@pytest.mark.parametrize("error", [ValueError("ours"), KeyboardInterrupt(), SystemExit(1)])
def test_anything_else_passes_through(error):
    with pytest.raises(type(error)) as passed:
        run(failing(error))
    assert passed.value is error


def test_work_that_ends_well_ends_quietly(capsys):
    done = []
    run(lambda: done.append(1))
    assert done == [1]
    assert capsys.readouterr() == ("", "")
