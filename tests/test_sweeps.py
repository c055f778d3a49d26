"""The jobs of a sweep: their names, what is left to do, and what is refused before any starts."""

import pickle
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from loading_process import from_a_loading_process
from most.config import Config, conf_dir, register, typed
from most.entry import run
from most.errors import ConfigError, DataError, FailedError, MostError, StoppedError
from most.sweeps import Job, as_job, by_key, check_jobs, in_sweep, job_name, report, standing, stopping
from semantickitti_tree import write_sequence


@pytest.fixture(scope="module", autouse=True)
def configurations():
    register()
    with initialize_config_dir(str(conf_dir()), version_base=None):
        yield


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    root = tmp_path_factory.mktemp("tree")
    for name in ("00", "01"):
        write_sequence(root, name, range(2))
    return root


@pytest.fixture
def make(tree, tmp_path, monkeypatch):
    """Make the job of some overrides, in ``outputs/most/sweep`` below an empty folder."""
    monkeypatch.chdir(tmp_path)
    splits = [f"dataset.splits.{split}=['{name}']" for split, name in (("train", "00"), ("val", "01"))]
    fixed = [f"dataset.root={tree}", *splits, "trainer=cpu", "stage=detection"]

    def made(*overrides):
        told = [*fixed, *overrides, f"hydra.sweep.subdir='{job_name(overrides)}'"]
        return Job(told, compose("train", told, return_hydra_config=True))

    return made


def leave(job: Job, *files: str, settings: Job | None = None) -> None:
    """Leave what a run leaves, begun with its own settings or another's."""
    began = settings or job
    (job.folder / ".hydra").mkdir(parents=True, exist_ok=True)
    choices = "".join(f"      {key}: {value}\n" for key, value in began.composed.hydra.runtime.choices.items())
    (job.folder / ".hydra/hydra.yaml").write_text(f"hydra:\n  runtime:\n    choices:\n{choices}")

    OmegaConf.save(began.settings(), job.folder / ".hydra/config.yaml")
    for name in files:
        (job.folder / name).parent.mkdir(exist_ok=True)
        (job.folder / name).write_text("{}")


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (["extent=track_max", "seed=1"], "extent-track_max+seed-1"),
        (["seed=1", "+experiment=sim_ablation", "extent=track_max"], "extent-track_max+seed-1"),
        (["stage.detection.epochs=2", "seed=1"], "seed-1+stage.detection.epochs-2"),
        (["logger=none", "logger.pictures=0", "trainer.threads=1", "dataset.root=a/b", "seed=3"], "seed-3"),
        (["trainer.validate_every=2"], "trainer.validate_every-2"),
        (["dataset.splits.val=['07']", "seed=1"], "seed-1+dataset.splits.val-__07__"),
        (["logger=none"], "default"),
    ],
)
def test_a_job_is_named_by_what_it_trains(overrides, name):
    assert job_name(overrides) == name
    OverridesParser.create().parse_override(f"stage1=sweep/{name}/checkpoints/detection-last.ckpt")  # needs no quotes


def test_long_names_stay_apart():
    names = {job_name(["seed=1", f"encoder.widths=[{'32,' * 40}{last}]"]) for last in (1, 2)}
    assert len(names) == 2
    assert all(len(name) <= 120 and name.startswith("seed-1+encoder.widths-_32_32") for name in names)


def test_jobs_write_below_the_folder_of_their_sweep_and_that_of_the_experiment(make):
    assert make("seed=2").folder == Path("outputs/most/sweep/seed-2")
    assert make("+experiment=sim_ablation", "seed=2").folder == Path("outputs/sim_ablation/sweep/seed-2")


def test_jobs_that_can_run_pass(make):
    check_jobs([make("extent=track_max", "seed=1"), make("extent=shrink_wrap", "seed=1")])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("seed=-1", r"job seed--1: seed: expected a number in"),
        ("dataset.root=nowhere", r"job default: nowhere/sequences: expected"),
        ("trainer.devices=2", r"job trainer.devices-2: trainer.devices: expected one process for each job"),
        ("stage=membership", r"job stage-membership: stage1: expected a checkpoint of stage 1, found none"),
        ("logger=none", r"default: expected jobs that differ in what they train, found two of this name"),
    ],
)
def test_one_job_that_cannot_run_refuses_them_all(make, wrong, message):
    with pytest.raises((ConfigError, DataError), match=message):
        check_jobs([make(*(["logger=csv"] if wrong == "logger=none" else ["seed=7"])), make(wrong)])


def test_jobs_of_one_name_are_told_all_that_a_name_leaves_out(make):
    jobs = [make("seed=1"), make("seed=1", "dataset.root=elsewhere")]
    with pytest.raises(ConfigError, match=r"two of this name; .* than .*logger, .*experiment, dataset\.root$"):
        check_jobs(jobs)


def test_a_finished_job_is_not_looked_at_further(make):
    job = make("seed=1")
    assert not job.finished
    leave(job, "metrics.json", "checkpoints/detection-last.ckpt")  # not even a checkpoint
    assert job.finished
    check_jobs([job])


def test_a_job_goes_on_with_its_latest_stage(make):
    job = make("seed=1")
    assert standing(job.folder) is None
    leave(job, "checkpoints/detection-last.ckpt")
    assert standing(job.folder) == str(job.folder / "checkpoints/detection-last.ckpt")
    (job.folder / "checkpoints/membership-last.ckpt").touch()
    assert standing(job.folder) == str(job.folder / "checkpoints/membership-last.ckpt")
    with pytest.raises(DataError, match=r"job seed-1: .*membership-last.ckpt: expected a checkpoint, found something"):
        check_jobs([job])


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ("stage.detection.epochs=3", "began with stage.detection.epochs = 3, found 20"),
        ("extent=shrink_wrap", "began with extent = shrink_wrap, found track_max"),
        ("dataset.splits.val=['00']", r"began with dataset.splits.val = \['00'\], found \['01'\]"),
    ],
)
def test_a_folder_of_other_settings_is_refused_whether_finished_or_not(make, other, message):
    job, expected = make("seed=1"), rf"job seed-1: outputs/most/sweep/seed-1 {message}; .* choose another hydra"
    leave(job, "metrics.json", settings=make("seed=1", other))
    with pytest.raises(ConfigError, match=expected):
        check_jobs([job])
    (job.folder / "metrics.json").unlink()
    leave(job, "checkpoints/detection-last.ckpt", settings=make("seed=1", other))
    with pytest.raises(ConfigError, match=expected):
        check_jobs([job])


@pytest.mark.parametrize("text", ["", "a: [", "- a", "hydra: 1"])
def test_settings_that_were_cut_off_in_writing_are_named(make, text):
    job = make("seed=1")
    leave(job, "metrics.json")
    for name in ("config.yaml", "hydra.yaml"):
        (job.folder / ".hydra" / name).write_text(text)
    with pytest.raises(DataError, match=r"job seed-1: .*/\.hydra: expected the settings that the run began with"):
        check_jobs([job])


def test_a_folder_in_which_nothing_was_trained_or_other_figureless_settings_held_is_taken(make):
    job = make("seed=1")
    leave(job, settings=make("seed=1", "stage.detection.epochs=3"))
    done = make("seed=2")
    leave(done, "metrics.json", settings=make("seed=2", "logger=none", "trainer.threads=1", "dataset.tables=a"))
    check_jobs([job, done])


def test_a_job_is_told_its_group_its_name_and_where_it_stopped(make):
    job = make("seed=1")
    leave(job, "checkpoints/detection-last.ckpt")
    config: Config = in_sweep(typed(job.settings()), "outputs/most/sweep", job.folder)
    assert (config.logger.group, config.name) == ("outputs/most/sweep", "seed-1")
    assert config.resume == str(job.folder / "checkpoints/detection-last.ckpt")
    grouped = typed(make("logger.group=mine", "seed=2").settings())
    assert in_sweep(grouped, "outputs/most/sweep", Path("elsewhere")).logger.group == "mine"


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (DataError("scan.bin: expected points"), "scan.bin: expected points"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero"),
        (UnicodeDecodeError("utf-8", b"a", 0, 1, "why"), "UnicodeDecodeError: 'utf-8' codec can't decode"),
    ],
)
def test_a_jobs_failure_can_be_passed_on(error, message):
    def work():
        raise error

    with pytest.raises(MostError, match=message) as failure:
        as_job(work)
    assert str(pickle.loads(pickle.dumps(failure.value))) == str(failure.value)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (DataError("scan.bin: expected points, found none"), "scan.bin: expected points, found none"),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero"),
        (KeyError("Tr"), "KeyError: 'Tr'"),
    ],
)
def test_a_job_that_fails_in_a_loading_process_is_reported_with_its_reason(make, capsys, error, told):
    with pytest.raises(MostError) as failure:
        as_job(from_a_loading_process(error).reraise)
    with pytest.raises(SystemExit) as stop:
        run(lambda: report([make("seed=1")], [failure.value]))
    assert stop.value.code == 1
    assert capsys.readouterr().err.endswith(f"outputs/most/sweep/seed-1: {told}\n")


def test_a_job_that_failed_twice_says_what_it_failed_at_first():
    def work():
        try:
            raise ZeroDivisionError("division by zero")
        finally:
            raise RuntimeError("cannot clean up")

    with pytest.raises(MostError, match="ZeroDivisionError: division by zero"):
        as_job(work)


def test_a_job_that_says_why_is_taken_at_its_word():
    def work():
        try:
            raise KeyError("tr")
        except KeyError as error:
            raise RuntimeError("no calibration") from error

    with pytest.raises(MostError, match="RuntimeError: no calibration"):
        as_job(work)


def test_a_job_that_ends_well_returns_what_it_reached():
    assert as_job(lambda: 0.5) == 0.5


def test_a_stopped_job_ends_the_sweep(capsys):
    def work():
        raise StoppedError("resume=FILE", 143)

    with pytest.raises(SystemExit) as stop:
        as_job(work)
    assert stop.value.code == 143
    assert capsys.readouterr().err == "most: interrupted; repeat the command to go on with the sweep\n"


def test_failed_jobs_are_reported_with_their_folders_and_reasons(make):
    jobs = [make("seed=1"), make("seed=2"), make("seed=3")]
    report(jobs, [0.5, 0.25, None])
    with pytest.raises(FailedError) as failure:
        report(jobs, [0.5, MostError("no room"), None])
    said = "1 of 3 jobs failed; repeat the command to try them again\n  outputs/most/sweep/seed-2: no room"
    assert (str(failure.value), failure.value.exit_code) == (said, 1)


def test_a_launcher_that_loses_a_process_names_what_is_left(make):
    jobs = [make("seed=1"), make("seed=2")]
    leave(jobs[0], "metrics.json")
    with pytest.raises(FailedError, match=r"\(OSError: killed\); .* go on with 1 of 2 jobs: seed-2"), stopping(jobs):
        raise OSError("killed")
    with pytest.raises(StoppedError, match="repeat the command") as stop, stopping(jobs):
        raise KeyboardInterrupt
    assert stop.value.exit_code == 130


def test_overrides_are_logged_by_key():
    assert by_key(["+experiment=a", "extent=track_max", "~logger"]) == {"experiment": "a", "extent": "track_max"}


def test_launchers_compose():
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    for launcher, package in (("processes", "joblib"), ("slurm", "submitit"), ("submitit_local", "submitit")):
        config = compose("train", [f"hydra/launcher={launcher}"], return_hydra_config=True)
        assert package in config.hydra.launcher._target_
    assert config.hydra.sweeper._target_.endswith("MostSweeper")
