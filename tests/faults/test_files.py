"""Nothing is lost: a few of the trials of `make faults`."""

import os
import random
import shutil

import pytest

from tests.campaigns.faults import disks, hostile_logs, inputs, kills, pipes, writers


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("faults")
    writers.prepare(place)
    return place


@pytest.fixture(scope="module")
def made(folder):
    """Return a function that gives what a command writes undisturbed, and how long it takes."""
    made_files = {}

    def of(command):
        if command not in made_files:
            made_files[command] = writers.new_files(folder, command)
        return made_files[command]

    return of


@pytest.mark.parametrize(
    "command",
    [pytest.param("simulate", marks=pytest.mark.campaign), "convert", "calibrate, a batch"],
)
def test_a_killed_writer_leaves_the_old_or_the_new_and_the_next_run_cleans(folder, made, command):
    new, taken = made(command)
    rng = random.Random(command)
    for _ in range(2):
        assert kills.killed(folder, command, new, taken, rng) is None
    assert kills.cleaned(folder, command, new) is None


@pytest.mark.parametrize("command", ["convert", "calibrate, a batch"])
def test_an_interrupt_is_one_line_and_130(folder, made, command):
    new, taken = made(command)
    rng = random.Random(1)
    for _ in range(2):
        assert kills.interrupted(folder, command, new, taken, rng) is None


def test_a_full_disk_is_one_line_and_the_older_file_stays(folder, made):
    new, _ = made("convert")
    for limit in (0, len(new["s.csv.zst"]) - 1):
        assert disks.full(folder, "convert", new, limit) is None
        assert (folder / "s.csv.zst").read_bytes() == writers.OLD


def test_half_a_file_is_seen_as_damage(folder, made):
    new, _ = made("convert")
    old = writers.old_files(folder, "convert")
    (folder / "s.csv.zst").write_bytes(new["s.csv.zst"][:-1])
    assert writers.damaged(folder, old, new) == "s.csv.zst is neither the old nor the new file"
    (folder / "s.csv.zst").unlink()
    assert writers.damaged(folder, old, new) == "s.csv.zst is gone"


def test_a_read_only_folder_is_one_line(folder, made):
    with disks.mounted(folder / "may", "size=64k") as allowed:
        if not allowed:
            pytest.skip("no memory file system may be mounted here")
    assert disks.into_read_only(folder, "budget") is None
    assert disks.into_read_only(folder, "calibrate, a batch") is None
    assert disks.on_small_disk(folder, "convert", made("convert")[0], 8) is None


def test_an_input_that_vanishes_or_grows_is_reported(folder):
    rng = random.Random(2)
    assert inputs.vanished(folder, rng) is None
    assert inputs.growing(folder, rng) is None


def test_two_writers_of_one_target_leave_the_one_or_the_other(folder):
    assert inputs.two_writers(folder) is None


@pytest.mark.campaign
def test_two_simulations_of_one_folder_leave_the_one_or_the_other(folder):
    assert inputs.two_simulations(folder) is None


def test_a_reader_that_goes_away_is_no_error(folder):
    for line in ("budget --imu nav440 --rate 10 -o -", "--help"):
        assert pipes.piped(folder, line.split()) is None
    assert pipes.headed(folder, "report c.json") is None


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no such device here")  # noqa: PTH110
def test_standard_output_on_a_full_disk_is_one_line(folder):
    for line in ("--help", "report c.json", "budget --imu nav440 --rate 10 -o -"):
        assert disks.onto_full_disk(folder, line) is None


def test_a_bad_log_ends_the_process_every_time(folder):
    # Arrow's threads once waited for ever at the end of a process whose read was cut short.
    hostile_logs.LOGS["a CSV bomb, gzip"].make(folder / "bomb.csv.gz")
    lines = [["allan", "bomb.csv.gz", "--max-bytes", "20M"] for _ in range(2)]
    processes = [writers.start(line, folder) for line in lines]
    for process in processes:
        err = process.communicate(timeout=60)[1].decode()
        assert (process.returncode, "raise the limit (option: --max-bytes)" in err) == (1, True)


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")
def test_a_failed_recipe_leaves_no_target(tmp_path):
    assert pipes.failed_recipe(tmp_path) is None


def test_the_device_is_still_one():
    assert not os.path.isfile(os.devnull)  # noqa: PTH113 (a device is what it must be)
