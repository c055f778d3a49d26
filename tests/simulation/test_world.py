import numpy as np
import pytest

from most.simulation import SensorSettings, SimulationSettings, TrafficSettings
from most.simulation.actors import Actor, Path
from most.simulation.boxes import boxes
from most.simulation.ground import ground
from most.simulation.mesh import box
from most.simulation.people import bicyclist, walker
from most.simulation.scene import Scene
from most.simulation.street import Street
from most.simulation.surfaces import Surface
from most.simulation.vehicles import bus, car, truck, van
from most.simulation.world import World

NOISE = 0.01
UP = np.array([0.0, 0.0, 5.0])


@pytest.fixture(scope="module")
def drive():
    """A world, three scans of it and their boxes."""
    sensor = SensorSettings(columns=256, range_noise=NOISE)
    traffic = TrafficSettings(persons=20, bicyclists=10, driving=6, rare=False)
    world = World(SimulationSettings(scans=3, sensor=sensor, traffic=traffic), "04")
    scans = [world.scan(index) for index in range(3)]
    return world, scans, boxes(world, scans)


def _in_world(scan) -> np.ndarray:
    return scan.points[:, :3].astype(float) @ scan.pose[:3, :3].T + scan.pose[:3, 3]


def test_points_of_an_instance_lie_in_its_box(drive):
    _, scans, truth = drive
    for row in np.flatnonzero(truth.points > 0):
        scan = scans[truth.scan[row]]
        own = _in_world(scan)[scan.labels == truth.instance[row] << 16 | truth.label[row]]
        c, s = np.cos(truth.yaw[row]), np.sin(truth.yaw[row])
        apart = (own - truth.centre[row]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        assert len(own) == truth.points[row]
        assert (np.abs(apart) <= truth.half_size[row] + 6 * NOISE).all()


def test_every_labelled_instance_has_a_box(drive):
    _, scans, truth = drive
    for index, scan in enumerate(scans):
        seen = set(np.unique(scan.labels[scan.labels >> 16 > 0]).tolist())
        rows = truth.scan == index
        assert seen <= set((truth.instance[rows] << 16 | truth.label[rows]).tolist())


def test_instance_ids_are_stable_and_belong_to_things_alone(drive):
    _, scans, _ = drive
    kinds: dict[int, int] = {}
    for scan in scans:
        for label in np.unique(scan.labels).tolist():
            instance, kind = label >> 16, label & 0xFFFF
            assert (instance > 0) == (kind in (10, 11, 18, 30, 31, 252, 253, 254, 258))
            if instance:
                assert kinds.setdefault(instance, kind) == kind


def test_what_stands_keeps_its_box_and_what_moves_has_the_velocity_it_says(drive):
    world, _, truth = drive
    moving = np.isin(truth.label, [252, 253, 254, 258])
    assert moving.any()
    assert not moving.all()
    for instance in np.unique(truth.instance):
        rows = np.flatnonzero(truth.instance == instance)
        steps = (
            np.diff(truth.centre[rows], axis=0)[:, :2] / (np.diff(truth.scan[rows]) * world.settings.period)[:, None]
        )
        if moving[rows[0]]:
            means = 0.5 * (truth.velocity[rows][1:] + truth.velocity[rows][:-1])
            assert steps == pytest.approx(means, abs=0.1)
            assert np.linalg.norm(truth.velocity[rows], axis=1).min() > 0.5
        else:
            assert np.array_equal(truth.centre[rows], np.repeat(truth.centre[rows[:1]], len(rows), 0))
            assert not truth.velocity[rows].any()


def test_road_of_every_scan_lies_on_the_same_land(drive):
    """A pose whose tilt is wrong by half a degree lifts the road at 20 m by 17 cm."""
    world, scans, _ = drive
    for scan in scans:
        road = _in_world(scan)[(scan.labels == 40) & (np.linalg.norm(scan.points[:, :2], axis=1) < 30)]
        assert len(road) > 1000
        assert np.abs(road[:, 2] - world.street.hills(road[:, :2])).max() < 6 * NOISE


def test_the_sensor_drives_forward_on_the_right_hand_side(drive):
    world, scans, _ = drive
    way = scans[1].pose[:3, 3] - scans[0].pose[:3, 3]
    assert np.linalg.norm(way[:2]) == pytest.approx(world.speed * world.settings.period, rel=0.1)
    assert scans[0].pose[:3, 0] @ way / np.linalg.norm(way) > 0.99
    assert scans[0].pose[1, 3] < 0
    assert np.linalg.det(scans[0].pose[:3, :3]) == pytest.approx(1)


def test_street_turns_and_its_ground_lies_where_it_says():
    street = Street(40.0, 60.0, np.random.default_rng(3))
    assert np.ptp(street.heading(np.linspace(0, 100, 50))) > np.radians(5)
    scene = Scene([ground(street, True, np.random.default_rng(0))], [0], [1.0])
    down = np.array([[0.0, 0, -1]])
    for s in (-20.3, 1.2, 31.7):
        for d in (-1.0, 0.7, street.carriageway - 0.3):
            place = street.position(s, d)
            hit = scene.cast(place + UP, down)
            assert hit.distance[0] == pytest.approx(5, abs=0.02)
            assert hit.label[0] in (40, 60)


def test_kerb_and_crossing():
    street = Street(40.0, 60.0, np.random.default_rng(3))
    middle, half = street.crossings[0]
    side = street.sides[1]
    walk = street.carriageway + side.parking + side.verge + 0.5 * side.sidewalk
    scene = Scene([ground(street, True, np.random.default_rng(0))], [0], [1.0])
    on_walk, on_crossing = (street.position(s, walk) for s in (middle + half + 3.3, middle))
    hits = [scene.cast(place + UP, np.array([[0.0, 0, -1]])) for place in (on_walk, on_crossing)]
    assert [int(hit.label[0]) for hit in hits] == [48, 40]
    assert on_walk[2] - street.hills(on_walk[:2]) == pytest.approx(0.13, abs=1e-6)
    assert on_crossing[2] - street.hills(on_crossing[:2]) == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("make", "length", "height"),
    [
        (car, (3.6, 5.0), (1.3, 1.7)),
        (van, (4.8, 6.0), (2, 2.6)),
        (truck, (7, 10), (3, 4)),
        (bus, (10, 12.5), (2.8, 3.3)),
    ],
)
def test_vehicles_have_plausible_sizes_and_stand_on_the_ground(make, length, height):
    for seed in range(5):
        mesh = make(np.random.default_rng(seed))
        low, high = mesh.vertices.min(0), mesh.vertices.max(0)
        assert length[0] <= high[0] - low[0] <= length[1]
        assert height[0] <= high[2] <= height[1]
        assert low[2] == pytest.approx(0, abs=0.03)


def test_box_of_a_walker_holds_all_of_the_step_and_limbs_do_move():
    actor = Actor(30, Path(0.0, -5.0, along=1.3), walker(1.8), cycles=1.0)
    lows = [actor.mesh(t).vertices.min(0) for t in np.linspace(0, 1, 7)]
    assert (np.array(lows) >= actor.low - 1e-9).all()
    assert np.ptp([low[0] for low in lows]) > 0.1
    assert actor.high[2] == pytest.approx(1.8, abs=0.05)
    assert len(bicyclist()) > 4


def test_labels_of_what_moves_differ():
    block = box((0, 0, 0), (1, 1, 1), Surface.PAINT)
    assert Actor(10, Path(0, 0), [block]).raw_class == 10
    assert Actor(10, Path(0, 0, along=1.0), [block]).raw_class == 252
