import pickle
from dataclasses import fields

import numpy as np
import pytest
import torch

from most.errors import DataError
from most.modal import cache
from most.modal.build import LabelRules, build_table
from most.modal.cache import cached_table, fingerprint
from most.modal.outline import Outlines

CAR, PERSON = 1 | 5 << 16, 2 | 1 << 16


@pytest.fixture
def sweeps(sweep_of):
    return [sweep_of({CAR: [[i, 0, 0], [3, 0, 1]], PERSON: [[4, 4, i]]}, index=i, yaw=i / 10) for i in range(3)]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "tables" / "00.npz"


def unread():
    raise AssertionError("the sweeps were read again")
    yield


def same(one, other):
    for field in fields(one):
        value, twin = getattr(one, field.name), getattr(other, field.name)
        assert same(value, twin) if isinstance(value, Outlines) else torch.equal(value, twin), field.name
    return True


def test_the_second_time_it_is_read(path, sweeps, rules):
    built = cached_table(path, "a", sweeps, 3, rules)
    assert same(built, build_table(sweeps, rules))
    assert same(built, cached_table(path, "a", unread(), 3, rules))
    assert [file.name for file in path.parent.iterdir()] == ["00.npz"]


def test_another_fingerprint_rebuilds(path, sweeps, rules):
    cached_table(path, "a", sweeps, 3, rules)
    assert len(cached_table(path, "b", sweeps[:1], 1, rules)) == 2
    assert len(cached_table(path, "b", unread(), 1, rules)) == 2


def test_another_rule_for_velocities_rebuilds(path, sweeps, rules):
    cached_table(path, "a", sweeps, 3, rules)
    strict = LabelRules(rules.to_training, rules.is_thing, rules.instance_of, max_gap=0.01)
    assert not cached_table(path, "a", sweeps, 3, strict).velocity_known.any()


@pytest.mark.parametrize("content", [b"", b"nonsense", pickle.dumps({"made_from": "a"}), b"PK\x03\x04 cut off"])
def test_a_damaged_or_foreign_file_is_rebuilt(path, sweeps, rules, content):
    path.parent.mkdir()
    path.write_bytes(content)
    assert len(cached_table(path, "a", sweeps, 3, rules)) == 6
    assert len(cached_table(path, "a", unread(), 3, rules)) == 6


def test_a_file_cut_off_or_with_a_flipped_byte_is_rebuilt(path, sweeps, rules):
    cached_table(path, "a", sweeps, 3, rules)
    whole = path.read_bytes()
    for broken in (whole[: len(whole) // 2], whole[:700] + bytes([whole[700] ^ 1]) + whole[701:]):
        path.write_bytes(broken)
        assert len(cached_table(path, "a", sweeps, 3, rules)) == 6


def test_a_file_with_entries_missing_is_rebuilt(path, sweeps, rules):
    path.parent.mkdir()
    np.savez(path, made_from=np.array(f"a max_gap={rules.max_gap}"))
    assert len(cached_table(path, "a", sweeps, 3, rules)) == 6


def test_nothing_is_left_behind_when_building_is_interrupted(path, sweeps, rules):
    def interrupted():
        yield sweeps[0]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached_table(path, "a", interrupted(), 3, rules)
    assert not path.parent.exists() or not list(path.parent.iterdir())


def test_a_place_that_cannot_be_written_is_named(tmp_path, sweeps, rules):
    (tmp_path / "file").touch()
    with pytest.raises(DataError, match=r"file.00\.npz: expected a place to keep the instance table"):
        cached_table(tmp_path / "file" / "00.npz", "a", sweeps, 3, rules)


def test_the_fingerprint_follows_what_a_table_is_made_from(tmp_path, monkeypatch):
    scan, poses = tmp_path / "000000.bin", tmp_path / "poses.txt"
    scan.write_bytes(b"12")
    poses.write_text("1 0 0")
    prints = [fingerprint([scan], [poses], {"map": [0, 1]})]
    assert fingerprint([scan], [poses], {"map": [0, 1]}) == prints[0]
    prints.append(fingerprint([scan], [poses], {"map": [0, 2]}))
    prints.append(fingerprint([], [poses], {"map": [0, 1]}))
    poses.write_text("1 0 1")
    prints.append(fingerprint([scan], [poses], {"map": [0, 1]}))
    scan.write_bytes(b"123")
    prints.append(fingerprint([scan], [poses], {"map": [0, 1]}))
    monkeypatch.setattr(cache, "FORMAT", cache.FORMAT + 1)
    prints.append(fingerprint([scan], [poses], {"map": [0, 1]}))
    assert len(set(prints)) == len(prints)
