import os
import signal
import subprocess
import sys

import pytest

from rotcli.files.atomic import atomic_write


def test_file_is_replaced_completely(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o640)
    with atomic_write(path) as stream:
        stream.write(b"new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_failure_leaves_the_old_file_and_no_other(tmp_path, kind):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(kind), atomic_write(path) as stream:
        stream.write(b"half")
        raise kind
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_link_is_written_through(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    link.symlink_to(target)
    with atomic_write(link) as stream:
        stream.write(b"new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_directory_is_refused(tmp_path):
    with pytest.raises(IsADirectoryError), atomic_write(tmp_path):
        pass


def test_what_a_killed_writer_left_is_removed_by_the_next_and_a_live_draft_is_not(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    program = (
        "import sys, time\nfrom rotcli.files.atomic import atomic_write\n"
        "with atomic_write(sys.argv[1]) as stream:\n"
        "    stream.write(b'half'); stream.flush(); print(flush=True); time.sleep(60)\n"
    )
    writer = subprocess.Popen([sys.executable, "-c", program, path], stdout=subprocess.PIPE)
    writer.stdout.readline()
    (draft,) = tmp_path.glob(".a.txt.*.part")
    with atomic_write(path) as stream:
        stream.write(b"second")
    assert draft.exists()  # its writer lives
    os.kill(writer.pid, signal.SIGKILL)
    writer.wait()
    writer.stdout.close()
    assert path.read_text() == "second"
    with atomic_write(path) as stream:
        stream.write(b"third")
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_drafts_of_other_files_and_what_only_looks_like_one_stay(tmp_path):
    others = [".b.txt.01234567.part", ".a.txt.part", ".a.txt.0123456g.part", "a.txt.01234567.part"]
    for name in others:
        (tmp_path / name).write_text("mine")
    (tmp_path / ".a.txt.01234567.part").write_text("litter")
    with atomic_write(tmp_path / "a.txt") as stream:
        stream.write(b"new")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*others, "a.txt"])


def test_a_device_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE)
    with atomic_write(pipe) as stream:
        stream.write(b"through")
    assert reader.communicate()[0] == b"through"
    assert pipe.is_fifo()
