import pytest

from detent.outputs.files import open_whole, write_whole


def test_what_is_written_replaces_what_was_there(tmp_path):
    path = tmp_path / "run.vcd"
    write_whole(path, b"one")
    with open_whole(path) as file:
        file.write(b"an")
        file.write(b"other")
        assert path.read_bytes() == b"one"
    assert path.read_bytes() == b"another"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_on_the_way_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "run.vcd"
    path.write_bytes(b"old")
    with pytest.raises(TypeError), open_whole(path) as file:
        file.writelines([b"half", None])
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
