"""Calibrations by file name, folder and pattern, for every command that applies them."""

import json
import shutil

import pytest

from rotcli.errors import ResultError
from rotcli.files.results.find import calibration_paths


@pytest.fixture
def folder(documents, tmp_path):
    docs = (documents.calibration("A", 10.0), documents.navigation("A", "full", 10.0, 1.0, 1.0))
    documents.write(tmp_path, *docs)
    (tmp_path / "truth.json").write_text("{}")
    return tmp_path


def test_of_a_folder_and_of_a_pattern_only_the_calibrations_are_applied(folder):
    (wanted,) = (
        str(path)
        for path in sorted(folder.glob("*.json"))
        if json.loads(path.read_text()).get("kind") == "calibration"
    )
    assert calibration_paths([str(folder)]) == (wanted,)
    assert calibration_paths([wanted, f"{folder}/*.json"]) == (wanted,)
    assert calibration_paths([wanted, wanted]) == (wanted, wanted)  # applied twice: refused later
    assert calibration_paths(["missing.json"]) == ("missing.json",)  # reported where it is read


def test_a_folder_without_a_calibration_is_an_error(folder, tmp_path):
    with pytest.raises(ResultError, match="no result files; check the folder or the pattern"):
        calibration_paths([f"{folder}/nothing*.json"])


def test_commands_take_a_folder(rotcli, folder):
    done = rotcli("budget", "--calibration", folder)
    assert done.status == 0, done.err
    (first,) = calibration_paths([str(folder)])
    shutil.copy(first, folder / "second.json")
    done = rotcli("budget", "--calibration", folder)
    assert done.status == 1
    assert done.err == f"rotcli: error: {folder}: 2 calibrations; name one of them\n"
