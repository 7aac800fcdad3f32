"""Writing under a temporary name: what is replaced, what never is, and what a killed writer leaves."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from auvid_cli.data.files import check_no_overlap, replacing, temporary_in, write_folder, write_text
from auvid_cli.errors import FileError

KILLED = """
import os, signal, sys
from pathlib import Path
from auvid_cli.data.files import replacing
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""

KILLED_WITH_A_FOLDER = """
import os, signal, sys
from pathlib import Path
from auvid_cli.data.files import temporary_in
with temporary_in(Path(sys.argv[1]), is_folder=True) as temporary:
    (temporary / "half").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.posix
def test_next_write_removes_files_of_killed_writer(tmp_path):
    result = subprocess.run([sys.executable, "-c", KILLED, tmp_path / "a.txt"], check=False)
    assert result.returncode == -signal.SIGKILL
    assert len(names(tmp_path)) == 1
    write_text(tmp_path / "b.txt", "whole")
    assert names(tmp_path) == {"b.txt"}


def test_writers_in_one_folder_keep_their_temporary_files(tmp_path):
    with replacing(tmp_path / "a.txt") as one, replacing(tmp_path / "b.txt") as other:
        write_text(tmp_path / "c.txt", "c")
        one.write_text("a")
        other.write_text("b")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {f"{x}.txt": x for x in "abc"}


def test_failed_write_keeps_the_earlier_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("before")
    with pytest.raises(TypeError):
        write_text(path, 1)
    assert (names(tmp_path), path.read_text()) == ({"a.txt"}, "before")


@pytest.mark.posix
def test_hidden_files_of_the_user_stay(tmp_path):
    (tmp_path / ".notes").write_text("mine")
    (tmp_path / ".auvid-link").symlink_to(tmp_path / ".notes")
    os.mkfifo(tmp_path / ".auvid-pipe")
    (tmp_path / ".auvid-mine").write_text("mine")
    write_text(tmp_path / "a.txt", "a")
    assert names(tmp_path) == {".notes", ".auvid-link", ".auvid-pipe", ".auvid-mine", "a.txt"}


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(os.path.relpath(path))


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


def link_to_device(path: Path) -> None:
    path.symlink_to("/dev/null")


@pytest.mark.parametrize("make", [make_pipe, Path.mkdir, make_socket, link_to_device])
@pytest.mark.posix
def test_pipe_device_or_folder_is_not_replaced(make, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "a.txt"
    make(path)
    before = path.lstat()
    with pytest.raises(FileError, match=r"a\.txt: cannot be written: .*not a file"):
        write_text(path, "a")
    assert os.path.samestat(path.lstat(), before)
    assert names(tmp_path) == {"a.txt"}


def test_file_behind_a_link_is_replaced(tmp_path):
    elsewhere = tmp_path / "disk/a.txt"
    (tmp_path / "a.txt").symlink_to(elsewhere)
    for text in ("new", "newer"):
        write_text(tmp_path / "a.txt", text)
        assert (tmp_path / "a.txt").is_symlink()
        assert elsewhere.read_text() == text
    assert names(elsewhere.parent) == {"a.txt"}


def test_loop_of_links_is_file_error(tmp_path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(FileError, match="a: cannot be written"):
        write_text(tmp_path / "a", "a")


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_input_is_recognised_under_any_name(link, tmp_path):
    (tmp_path / "read.yaml").write_text("a")
    link(tmp_path / "other", tmp_path / "read.yaml")
    check_no_overlap([tmp_path / "new"], [tmp_path / "read.yaml", tmp_path / "missing"])
    for name in ("read.yaml", "other"):
        with pytest.raises(FileError, match="would be written over"):
            check_no_overlap([tmp_path / name], [tmp_path / "read.yaml"])


def test_new_folder_is_complete_with_usual_rights(tmp_path):
    write_folder(tmp_path / "a" / "b", {"x.txt": "1", "y.txt": "2"})
    assert names(tmp_path / "a") == {"b"}
    assert {path.name: path.read_text() for path in (tmp_path / "a" / "b").iterdir()} == {"x.txt": "1", "y.txt": "2"}
    assert (tmp_path / "a" / "b").stat().st_mode == (tmp_path / "a").stat().st_mode


def test_empty_folder_keeps_its_inode(tmp_path):
    before = tmp_path.stat().st_ino
    write_folder(tmp_path, {"x.txt": "1"})
    assert names(tmp_path) == {"x.txt"}
    assert tmp_path.stat().st_ino == before


@pytest.mark.parametrize("stands", ["file", "filled", "dangling"])
def test_new_folder_replaces_nothing(stands, tmp_path):
    place = tmp_path / "a"
    match stands:
        case "file":
            place.write_text("mine")
        case "filled":
            place.mkdir()
            (place / ".hidden").write_text("mine")
        case "dangling":
            place.symlink_to(tmp_path / "nowhere")
    before = names(tmp_path)
    with pytest.raises(FileError, match=r"exists already, and is not (a folder|empty)"):
        write_folder(place, {"x.txt": "1"})
    assert names(tmp_path) == before


def test_next_write_removes_folder_of_killed_writer(tmp_path):
    for place, folder in ((tmp_path, tmp_path / "a"), (tmp_path / "b", tmp_path / "b")):
        place.mkdir(exist_ok=True)
        subprocess.run([sys.executable, "-c", KILLED_WITH_A_FOLDER, place], check=False)
        assert len(names(place)) == 1
        write_folder(folder, {"x.txt": "1"})
        assert names(folder) == {"x.txt"}
        assert names(place) == {"a"} if place == tmp_path else {"x.txt"}


def test_folder_of_running_writer_stays(tmp_path):
    with temporary_in(tmp_path, is_folder=True) as other:
        write_folder(tmp_path / "a", {"x.txt": "1"})
        write_text(tmp_path / "b.txt", "b")
        assert other.is_dir()
    assert names(tmp_path) == {"a", "b.txt"}


def test_failed_folder_leaves_nothing(tmp_path):
    # The second file lies in a folder that is not there.
    with pytest.raises(FileError, match="a: cannot be written"):
        write_folder(tmp_path / "a", {"x.txt": "1", "no/y.txt": "2"})
    assert names(tmp_path) == set()
    with pytest.raises(FileError, match=r"cannot be (written|read): File name too long"):
        write_folder(tmp_path / ("a" * 300), {"x.txt": "1"})


def test_temporary_of_another_machine_stays(tmp_path):
    left = tmp_path / f".auvid-00000000-{2**22 + 1}-0123456789abcdef"
    left.write_text("half")
    write_text(tmp_path / "a.txt", "a")
    assert left.exists()
