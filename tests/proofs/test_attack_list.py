"""Each line of the attack list in the documentation names a test, and that test is there."""

import re
from pathlib import Path

HERE = Path(__file__).parents[2]
LINE = re.compile(r"^\| .* \| .* \| `(tests/[\w/]+\.py)::(test_\w+)` \|$")


def test_every_attack_on_the_list_has_its_test() -> None:
    page = (HERE / "docs/security.md").read_text("utf-8").partition("## The attack list")[2].partition("\n## ")[0]
    rows = [line for line in page.splitlines() if line.startswith("| ")][1:]
    assert len(rows) >= 30
    for row in rows:
        found = LINE.match(row)
        assert found, f"no test is named: {row}"
        assert f"def {found[2]}(" in (HERE / found[1]).read_text("utf-8"), f"{found[1]} has no {found[2]}"
