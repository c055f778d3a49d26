"""Settings by dotted keys."""

from most.keys import flat, is_of


def test_nested_settings_have_dotted_keys():
    assert flat({"seed": 1, "stage": {"run": ["a"], "detection": {"epochs": 2}}, "none": {}}) == {
        "seed": 1,
        "stage.run": ["a"],
        "stage.detection.epochs": 2,
    }


def test_a_key_is_of_its_groups_and_of_no_beginning_of_a_name():
    assert is_of("grid", ["grid"])
    assert is_of("grid.voxel_size", ["seed", "grid"])
    assert not is_of("grids", ["grid"])
    assert not is_of("grid", ["grid.voxel_size"])
