"""The picture of the page on replacing a box is made by a script that still runs."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_picture_of_the_page_is_drawn(tmp_path: Path) -> None:
    spec = spec_from_file_location("real_figures", DOCS / "real_figures.py")
    assert spec is not None
    assert spec.loader is not None
    script = module_from_spec(spec)
    sys.modules["real_figures"] = script
    spec.loader.exec_module(script)
    script.main(tmp_path)
    drawn = {path.name for path in tmp_path.iterdir()}
    assert drawn == set(script.PICTURES)
    page = (DOCS / "how-to" / "replace-the-box.md").read_text()
    assert all(name in page and (DOCS / "pictures" / name).is_file() for name in drawn)
