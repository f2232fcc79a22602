"""The pictures of the page on motors are made by a script that still runs."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_every_picture_of_the_page_is_drawn(tmp_path: Path) -> None:
    spec = spec_from_file_location("motor_figures", DOCS / "motor_figures.py")
    assert spec is not None
    assert spec.loader is not None
    script = module_from_spec(spec)
    sys.modules["motor_figures"] = script
    spec.loader.exec_module(script)
    script.main(tmp_path)
    drawn = {path.name for path in tmp_path.iterdir()}
    assert drawn == {path.name for path in (DOCS / "pictures").glob("motor-*.png")}
    page = (DOCS / "how-to" / "motors.md").read_text()
    assert all(name in page for name in drawn)
