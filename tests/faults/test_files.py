"""Nothing is lost: a few of the trials of `make faults`."""

import os
import random
import shutil

import pytest

from faults import files


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("faults")
    files.prepare(place)
    return place


@pytest.mark.parametrize("command", ["simulate", "convert"])
def test_a_killed_writer_leaves_the_old_or_the_new_and_the_next_run_cleans(folder, command):
    new, taken = files.new_files(folder, command)
    rng = random.Random(command)
    for _ in range(4):
        assert files.killed(folder, command, new, taken, rng) is None
    assert files.cleaned(folder, command) is None


def test_an_interrupt_is_one_line_and_130(folder):
    new, taken = files.new_files(folder, "convert")
    rng = random.Random(1)
    for _ in range(3):
        assert files.interrupted(folder, "convert", new, taken, rng) is None


@pytest.mark.parametrize("limit", [0, 3000])
def test_a_full_disk_is_one_line_and_the_older_file_stays(folder, limit):
    assert files.full(folder, "convert", limit) is None
    assert (folder / "s.csv").read_bytes() == files.OLD


def test_a_read_only_folder_is_one_line(folder):
    with files.mounted(folder / "may", "size=64k") as allowed:
        if not allowed:
            pytest.skip("no memory file system may be mounted here")
    assert files.into_read_only(folder, "budget") is None
    assert files.on_small_disk(folder, "convert", 8) is None


def test_an_input_that_vanishes_or_grows_is_told(folder):
    rng = random.Random(2)
    assert files.vanished(folder, rng) is None
    assert files.growing(folder, rng) is None


def test_two_writers_of_one_target_leave_the_one_or_the_other(folder):
    assert files.two_writers(folder) is None


def test_a_reader_that_goes_away_is_no_error(folder):
    assert files.piped(folder, ["budget", "--imu", "nav440", "-o", "-"]) is None


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not here")
def test_a_failed_recipe_leaves_no_target(tmp_path):
    assert files.failed_recipe(tmp_path) is None


def test_the_device_is_still_one():
    assert not os.path.isfile(os.devnull)  # noqa: PTH113 (a device is what it must be)
