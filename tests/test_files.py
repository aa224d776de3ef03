"""Writing files so that nobody ever sees half of one."""

import errno
import os
import stat
import threading

import pytest
from truepath.errors import InputError
from truepath.files import write_atomically


@pytest.fixture
def target(tmp_path):
    path = tmp_path / "folder" / "result.json"
    path.parent.mkdir()
    path.write_bytes(b"old content")
    return path


def alone(path):
    return [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_a_new_file_is_written(tmp_path):
    path = tmp_path / "new.txt"
    write_atomically(path, "content\n")
    assert path.read_bytes() == b"content\n"
    assert alone(path)


def test_an_old_file_is_replaced_as_a_whole(target):
    write_atomically(target, "new")
    assert target.read_bytes() == b"new"
    assert alone(target)


def test_the_path_may_be_a_string(target):
    write_atomically(str(target), "new")
    assert target.read_bytes() == b"new"


def test_text_is_written_as_utf8_with_its_line_ends_as_they_are(target):
    write_atomically(target, "5 µm\r\n\n")
    assert target.read_bytes() == b"5 \xc2\xb5m\r\n\n"


def test_bytes_are_written_as_they_are(target):
    write_atomically(target, b"\x00\xff\r\n")
    assert target.read_bytes() == b"\x00\xff\r\n"


@pytest.mark.parametrize("call", ["fsync", "replace", "chmod"])
@pytest.mark.parametrize("content", ["new content", b"new" * 100_000])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_beside_it(target, monkeypatch, call, content):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, call, full)
    with pytest.raises(InputError, match="cannot write this file") as caught:
        write_atomically(target, content)
    assert caught.value.found == "No space left on device"
    assert target.read_bytes() == b"old content"
    assert alone(target)


def test_an_interrupted_write_leaves_the_old_file_and_nothing_beside_it(target, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(target, "new")
    assert target.read_bytes() == b"old content"
    assert alone(target)


def test_text_that_cannot_be_encoded_leaves_the_old_file_and_nothing_beside_it(target):
    with pytest.raises(UnicodeEncodeError):
        write_atomically(target, "half a character: \ud800")
    assert target.read_bytes() == b"old content"
    assert alone(target)


def test_a_folder_that_does_not_exist_is_told_with_the_path(tmp_path):
    path = tmp_path / "nowhere" / "file.txt"
    with pytest.raises(InputError, match="cannot write here") as caught:
        write_atomically(path, "x")
    assert str(path) in str(caught.value)
    assert "No such file or directory" in caught.value.found


def test_a_folder_is_not_overwritten(target):
    with pytest.raises(InputError, match="the output is no file"):
        write_atomically(target.parent, "x")
    assert target.read_bytes() == b"old content"
    assert list(target.parent.parent.iterdir()) == [target.parent]


def test_the_permissions_of_an_old_file_are_kept(target):
    target.chmod(0o640)
    write_atomically(target, "new")
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


def test_a_new_file_may_be_read_by_whom_the_umask_lets(tmp_path):
    before = os.umask(0o027)
    try:
        write_atomically(tmp_path / "new", "x")
        assert os.umask(0o027) == 0o027
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


def test_a_reader_at_any_moment_sees_one_version_as_a_whole(target):
    versions = [bytes([letter]) * 300_000 for letter in b"ab"]
    target.write_bytes(versions[0])
    done, seen = threading.Event(), set()

    def read():
        while not done.is_set():
            seen.add(target.read_bytes())

    reader = threading.Thread(target=read)
    reader.start()
    try:
        for k in range(40):
            write_atomically(target, versions[k % 2])
    finally:
        done.set()
        reader.join()
    assert seen <= set(versions)
    assert seen


def test_a_link_stays_a_link_and_its_target_is_replaced(tmp_path):
    target, link = tmp_path / "target.txt", tmp_path / "link.txt"
    target.write_text("old")
    link.symlink_to(target)
    write_atomically(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_a_pipe_is_refused_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="the output is no file"):
        write_atomically(pipe, "new")
    assert pipe.is_fifo()
