import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from detent.realtime import image_names
from detent.realtime import images as module
from detent.realtime.images import (
    Images,
    ImagesUnusable,
    ImageUnreadable,
    cell_name,
    default_folder,
    pack,
    unpack,
)
from detent.realtime.system import lock

IMAGE = bytes(range(119))
MODELS = {"bar": "gs-c200", "drill": "gs-c200s"}


class Kept(Images):
    """Images that note their warnings."""

    def __init__(self, folder: Path) -> None:
        self.warnings: list[str] = []
        super().__init__(folder, "cell", MODELS, warn=self.warnings.append)


@pytest.fixture
def images(tmp_path: Path) -> Iterator[Kept]:
    made = Kept(tmp_path)
    yield made
    made.close()


@given(st.binary(max_size=300), st.text(max_size=20))
def test_what_is_packed_comes_out_again(image: bytes, model: str) -> None:
    model = model.encode("utf-8", "replace").decode()
    assert unpack(pack(image, model), model) == image


@given(st.integers(0, len(pack(IMAGE, "gs-c200")) - 1), st.integers(1, 255))
def test_no_damaged_byte_goes_unnoticed(index: int, change: int) -> None:
    data = bytearray(pack(IMAGE, "gs-c200"))
    data[index] ^= change
    with pytest.raises(ImageUnreadable):
        unpack(bytes(data), "gs-c200")


@given(st.integers(0, len(pack(IMAGE, "gs-c200")) - 1))
def test_no_missing_end_goes_unnoticed(length: int) -> None:
    with pytest.raises(ImageUnreadable):
        unpack(pack(IMAGE, "gs-c200")[:length], "gs-c200")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "no EEPROM image of Detent"),
        (pack(IMAGE, "gs-c200")[:10], "cut short"),
        (pack(IMAGE, "gs-c200") + b"x", "has 147 bytes instead of 146"),
        (pack(IMAGE, "gs-c200s"), "belongs to a gs-c200s, not a gs-c200"),
        (module.MAGIC + b"\0\2" + bytes(20), "version 2, and only version 1"),
        (pack(IMAGE, "gs-c200")[:-1] + b"x", "checksum is wrong"),
    ],
)
def test_what_is_wrong_is_said(data: bytes, says: str) -> None:
    with pytest.raises(ImageUnreadable, match=says):
        unpack(data, "gs-c200")


def test_what_was_saved_is_there_the_next_time(tmp_path: Path) -> None:
    images = Kept(tmp_path)
    assert images.load() == ({}, [])
    assert images.save("drill", b"old")
    assert images.save("drill", IMAGE)
    images.close()
    images = Kept(tmp_path)
    assert images.load() == ({"drill": IMAGE}, [])
    images.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "cell.drill.eeprom", "cell.drill.eeprom.old", "cell.lock",
    ]  # fmt: skip


def test_a_damaged_image_is_moved_aside_and_never_overwritten(images: Kept) -> None:
    path = images.path("bar")
    for number, content in enumerate((b"first", b"second"), 1):
        path.write_bytes(content)
        found = images.load()
        aside = path.with_name(f"cell.bar.eeprom.damaged-{number}")
        assert found.images == {}
        assert found.reports == [f"{path}: it is no EEPROM image of Detent; it is {aside} now, and bar starts empty"]
        assert aside.read_bytes() == content
        assert not path.exists()


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.ESTALE, errno.EMFILE])
def test_what_the_system_does_not_let_be_read_is_left_alone_and_nothing_is_served(
    images: Kept, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """It may be a good image: a unit that began empty in its place would store over it."""
    assert images.save("bar", IMAGE)
    path = images.path("bar")

    def refused(*_: object) -> bytes:
        raise OSError(number, os.strerror(number), str(path))

    with monkeypatch.context() as broken:
        broken.setattr("detent.realtime.images.read_kept", refused)
        with pytest.raises(ImagesUnusable, match=f"{path} cannot be read: {os.strerror(number)}; .* --state DIR"):
            images.load()
    assert images.load().images == {"bar": IMAGE}


def test_what_cannot_be_moved_aside_is_said(images: Kept, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_rename(*_: object) -> None:
        raise OSError(30, "Read-only file system")

    images.path("bar").write_bytes(b"?")
    monkeypatch.setattr(Path, "rename", no_rename)
    assert "it cannot be moved aside (Read-only file system), and bar starts empty" in images.load().reports[0]


@pytest.mark.parametrize("function", ["replace", "fsync"])
def test_a_failed_save_keeps_the_old_image_and_warns_once(
    images: Kept, monkeypatch: pytest.MonkeyPatch, function: str
) -> None:
    assert images.save("bar", b"old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, function, full)
        assert not images.save("bar", IMAGE)
        assert not images.save("bar", IMAGE)
    path = images.path("bar")
    assert images.warnings == [f"{path}: not written: No space left on device; the image before it is kept"]
    assert images.load() == ({"bar": b"old"}, [])
    assert sorted(p.name for p in path.parent.iterdir()) == ["cell.bar.eeprom", "cell.lock"]
    assert images.save("bar", IMAGE)
    assert images.load().images == {"bar": IMAGE}


def test_a_save_into_a_folder_that_was_removed_fails_without_an_exception(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    images = Kept(folder)
    (folder / "cell.lock").unlink()
    folder.rmdir()
    assert not images.save("bar", IMAGE)
    assert "No such file or directory" in images.warnings[0]
    images.close()


def test_a_folder_that_cannot_be_made_is_an_error_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(ImagesUnusable, match=r"cannot be kept in .*/file/state: Not a directory; .* --state DIR"):
        Kept(tmp_path / "file" / "state")


def test_one_process_at_a_time_has_the_images(tmp_path: Path) -> None:
    images = Kept(tmp_path)
    with pytest.raises(ImagesUnusable, match=r"/cell\.lock is locked: another process .* --state DIR"):
        Kept(tmp_path)
    images.close()
    images.close()
    Kept(tmp_path).close()


def test_images_can_be_read_by_whoever_may_read_the_folder(images: Kept) -> None:
    images.save("bar", IMAGE)
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(images.path("bar").stat().st_mode) == 0o666 & ~mask


def test_names_of_files_are_safe_and_never_the_same(tmp_path: Path) -> None:
    units = ["a", "a/b", "a_b", "a b", "../x", "A.b", "", "x" * 300, "x" * 301]
    images = Images(tmp_path, "cell", dict.fromkeys(units, "gs-c200"))
    paths = [images.path(unit) for unit in units]
    assert len(set(paths)) == len(units)
    for unit, path in zip(units, paths, strict=True):
        assert path.parent == tmp_path
        assert images.save(unit, unit.encode())
    assert images.load().images == {unit: unit.encode() for unit in units}
    images.close()


def test_cell_files_of_one_name_in_two_folders_do_not_share_images(tmp_path: Path) -> None:
    names = [cell_name(str(tmp_path / folder / "drilling.toml"), is_file=True) for folder in ("a", "b", "b/../a")]
    assert names[0] != names[1]
    assert names[0] == names[2]
    assert all(name.startswith("drilling-") for name in names)
    assert cell_name("gs-c200", is_file=False) == "gs-c200"


def test_images_are_kept_where_the_system_keeps_state() -> None:
    assert default_folder({"XDG_STATE_HOME": "/var/state"}) == Path("/var/state/detent")
    assert default_folder({"XDG_STATE_HOME": "not/absolute"}) == Path.home() / ".local/state/detent"
    assert default_folder({}) == Path.home() / ".local/state/detent"


# -- whose images they are -----------------------------------------------------------------------------------

UNITS = {"u": "gs-c200"}


def opened(state: Path, cell: Path, models: dict[str, str] = UNITS) -> tuple[Images, list[str], dict[str, bytes]]:
    images = Images.of(state, str(cell), models, is_file=True)
    found = images.load()
    images.close()
    return images, found.reports, found.images


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A cell file whose unit has kept an image."""
    file = tmp_path / "a" / "mm.toml"
    file.parent.mkdir()
    file.write_text("x")
    images, reports, found = opened(tmp_path / "state", file)
    assert (reports, found) == ([], {})
    assert images.path("u").name == "mm.u.eeprom"
    assert images.save("u", IMAGE)
    return file


@pytest.mark.parametrize("to", ["b/mm.toml", "a/other.toml", "b/other.toml"])
def test_a_cell_that_is_moved_or_renamed_finds_its_images_again(cell: Path, tmp_path: Path, to: str) -> None:
    new = tmp_path / to
    new.parent.mkdir(exist_ok=True)
    cell.rename(new)
    for said in (1, 0):
        _, reports, found = opened(tmp_path / "state", new)
        assert found == {"u": IMAGE}
        assert len(reports) == said
    assert f'path = "{new}"' in (tmp_path / "state" / "mm.cell").read_text()


def test_a_process_that_stands_still_with_the_lock_is_not_waited_for_without_an_end(
    cell: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(image_names, "PATIENCE", 0.0)
    with open(tmp_path / "state" / "cells.lock") as other:
        lock(other.fileno())
        with pytest.raises(ImagesUnusable, match=r"another process has .*cells.lock and does not let go of it; choose"):
            opened(tmp_path / "state", cell)
    assert opened(tmp_path / "state", cell)[2] == {"u": IMAGE}


ODD = ["a b", 'a"b', "a\\b", "a\nb", "a\x7fb", "\u00e9", "\u2028", "\U0001f600", "\udcff", "#", "'", "\x1b[2J"]


@pytest.mark.skipif(os.name == "nt", reason="names of files are bytes on POSIX alone")
@pytest.mark.parametrize("name", ODD, ids=ascii)
def test_a_cell_finds_its_images_again_whatever_its_folder_is_called(tmp_path: Path, name: str) -> None:
    file = tmp_path / name / "mm.toml"
    file.parent.mkdir()
    file.write_text("x")
    images, _, _ = opened(tmp_path / "state", file)
    assert images.save("u", IMAGE)
    assert opened(tmp_path / "state", file)[1:] == ([], {"u": IMAGE})


def test_a_cell_that_is_moved_by_copying_finds_them_by_its_name_and_its_units(cell: Path, tmp_path: Path) -> None:
    new = tmp_path / "mm.toml"
    new.write_text("x")
    cell.unlink()
    _, reports, found = opened(tmp_path / "state", new)
    assert found == {"u": IMAGE}
    assert reports == [f"{new} was {cell}: its EEPROM images {tmp_path}/state/mm.*.eeprom are used"]


def test_a_copy_of_a_cell_begins_empty_and_is_told_whose_the_images_are(cell: Path, tmp_path: Path) -> None:
    new = tmp_path / "mm.toml"
    new.write_text("x")
    images, reports, found = opened(tmp_path / "state", new)
    assert found == {}
    assert images.path("u").name == "mm-2.u.eeprom"
    assert reports == [
        f"{new} begins with empty EEPROMs: {tmp_path}/state/mm.*.eeprom are those of {cell}, which is there still"
    ]
    assert opened(tmp_path / "state", cell)[2] == {"u": IMAGE}


def test_what_is_not_certain_is_told_with_the_way_to_use_it(cell: Path, tmp_path: Path) -> None:
    """Another name, and another file on the disk: perhaps the same cell, perhaps not."""
    new = tmp_path / "other.toml"
    new.write_text("x")
    cell.unlink()
    _, reports, found = opened(tmp_path / "state", new)
    assert found == {}
    assert f"if it was {cell}, its images are {tmp_path}/state/mm.*.eeprom: write its path into" in reports[0]
    (tmp_path / "state" / "other.cell").unlink()
    key = tmp_path / "state" / "mm.cell"
    key.write_text(key.read_text().replace(str(cell), str(new)))
    assert opened(tmp_path / "state", new)[2] == {"u": IMAGE}


def test_two_cells_of_one_name_are_served_side_by_side_before_either_has_an_image(tmp_path: Path) -> None:
    made = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        file = tmp_path / folder / "mm.toml"
        file.write_text("x")
        made.append(Images.of(tmp_path / "state", str(file), UNITS, is_file=True))
    assert [images.path("u").name for images in made] == ["mm.u.eeprom", "mm-2.u.eeprom"]
    for images in made:
        images.close()


def test_images_under_their_old_name_of_digits_are_taken_over(tmp_path: Path) -> None:
    file = tmp_path / "mm.toml"
    file.write_text("x")
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / f"{cell_name(str(file), is_file=True)}.u.eeprom").write_bytes(pack(IMAGE, "gs-c200"))
    assert opened(tmp_path / "state", file)[2] == {"u": IMAGE}


def test_a_key_that_cannot_be_read_is_nobodys(cell: Path, tmp_path: Path) -> None:
    (tmp_path / "state" / "mm.cell").write_bytes(b"\xff = [")
    images, _, found = opened(tmp_path / "state", cell)
    assert found == {}
    assert images.path("u").name == "mm-2.u.eeprom"


def test_another_models_image_gets_the_name_of_that_and_comes_back_with_it(tmp_path: Path) -> None:
    def kept(model: str) -> tuple[dict[str, bytes], list[str], Images]:
        images = Images(tmp_path, "cell", {"u": model})
        found = images.load()
        images.close()
        return found.images, found.reports, images

    kept("gs-c200s")[2].save("u", b"s")
    found, reports, images = kept("gs-c200")
    assert found == {}
    apart = tmp_path / "cell.u.gs-c200s.eeprom"
    path = tmp_path / "cell.u.eeprom"
    assert reports == [
        f"{path}: it belongs to a gs-c200s, not a gs-c200; it is {apart} now, and is used again when u is a gs-c200s"
    ]
    images.save("u", b"c")
    assert kept("gs-c200s")[0] == {"u": b"s"}
    assert kept("gs-c200")[0] == {"u": b"c"}
    assert not list(tmp_path.glob("*damaged*"))


@pytest.mark.parametrize("kind", ["pipe", "link", "huge", "folder"])
def test_what_is_no_file_that_an_image_could_be_is_refused_at_once(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "cell.bar.eeprom"
    match kind:
        case "pipe":
            os.mkfifo(path)
        case "link":
            path.symlink_to(tmp_path / "elsewhere")
        case "folder":
            path.mkdir()
        case "huge":
            with path.open("wb") as file:
                file.truncate(2 << 30)
    with pytest.raises(ImagesUnusable, match=r"and no EEPROM image: move it away, or .* --state DIR"):
        Kept(tmp_path)


@pytest.mark.parametrize("name", ["cell.bar.eeprom.new", "cell.bar.eeprom.older", "cell.bar.eeprom"])
def test_a_save_follows_no_link(images: Kept, tmp_path: Path, name: str) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    images.save("bar", b"first")
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / name).symlink_to(precious)
    assert images.save("bar", IMAGE)
    assert precious.read_text() == "mine"
    assert images.load().images == {"bar": IMAGE}


def test_the_image_before_the_last_is_kept_and_named_when_that_is_damaged(images: Kept) -> None:
    for content in (b"first", b"second"):
        assert images.save("bar", content)
    old = images.path("bar").with_name("cell.bar.eeprom.old")
    assert unpack(old.read_bytes(), "gs-c200") == b"first"
    images.path("bar").write_bytes(b"?")
    assert images.load().reports[0].endswith(f"{old} is the image before it: rename it to use it")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
@pytest.mark.parametrize("kind", ["pipe", "link to a device", "folder", "link to a pipe", "huge"])
def test_what_stands_under_the_name_of_a_cell_and_is_no_key_is_neither_waited_for_nor_read_for_ever(
    tmp_path: Path, kind: str
) -> None:
    state, target = tmp_path / "state", tmp_path / "cell.toml"
    state.mkdir()
    target.write_text("")
    for place in (state / "another.cell", state / "cell.cell"):
        match kind:
            case "pipe":
                os.mkfifo(place)
            case "link to a device":
                place.symlink_to("/dev/zero")
            case "folder":
                place.mkdir()
            case "link to a pipe":
                os.mkfifo(tmp_path / f"{place.name}.pipe")
                place.symlink_to(tmp_path / f"{place.name}.pipe")
            case "huge":
                with place.open("wb") as file:
                    file.truncate(1 << 40)
    if kind == "folder":
        with pytest.raises(ImagesUnusable, match="cannot be kept"):
            Images.of(state, str(target), {"u": "gs-c200"}, is_file=True)
        return
    images = Images.of(state, str(target), {"u": "gs-c200"}, is_file=True)
    assert images.save("u", b"image")
    images.close()
    again = Images.of(state, str(target), {"u": "gs-c200"}, is_file=True)
    assert again.load().images == {"u": b"image"}
    again.close()
