"""The scripts of the pages: their types by tsc, and what of them knows no page under node.

tsc is taken from npm once (`make test` does that) and kept in ``.venv/tsc``; without it, or without node, these tests
are skipped. The tests themselves are in ``scripts/``.
"""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from detent.workbench.scope import ScopeData
from detent.workbench.scope_feed import frame, packed

ROOT = Path(__file__).parents[2]
SCRIPTS = Path(__file__).parent / "scripts"
ASSETS = ROOT / "src" / "detent" / "workbench" / "assets"
TSC = ROOT / ".venv" / "tsc" / "node_modules" / ".bin" / "tsc"
PURE = sorted(path.name for path in SCRIPTS.glob("*.test.mjs"))

needs_tsc = pytest.mark.skipif(not TSC.exists(), reason="tsc is not there: make tsc (npm) fetches it")
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")


WRONG = {
    "detent.call();": "Expected at least 1 arguments",
    'detent.call("holt");': "'\"holt\"' is not assignable to parameter of type 'keyof Calls'",
    'detent.call("power", "bar");': "Expected 3 arguments",
    'detent.call("places").then((found) => found.modles);': "Property 'modles' does not exist on type 'Places'",
    'detent.get("held").length;': "Property 'length' does not exist on type 'boolean'",
    'detent.talk("x");': "Property 'talk' does not exist",
    'import { grouped } from "./forms.js";\ngrouped("7");': "not assignable to parameter of type 'number'",
    "const { missing } = window.detent;": "Property 'missing' does not exist",
    "export function untold(what) {\n  return what;\n}": "'what' implicitly has an 'any' type",
    'document.querySelector("p").remove();': "Object is possibly 'null'",
    "try {\n  detent.keys();\n} catch (error) {\n  error.message;\n}": "'error' is of type 'unknown'",
}


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """What tsc says of the scripts, with a file more for each line of `WRONG`: one run, as it takes seconds."""
    folder = tmp_path_factory.mktemp("types")
    shutil.copytree(ASSETS, folder / "assets")
    for n, wrong in enumerate(WRONG):
        (folder / "assets" / f"wrong{n}.js").write_text(f"{wrong}\n")
    options = json.loads((SCRIPTS / "jsconfig.json").read_text())
    options["include"] = ["assets/*.js", *map(str, SCRIPTS.glob("*.d.ts"))]
    (folder / "jsconfig.json").write_text(json.dumps(options))
    done = subprocess.run([TSC, "-p", folder / "jsconfig.json"], capture_output=True, text=True)
    assert done.returncode != 0
    return done.stdout.splitlines()


@needs_tsc
def test_the_types_of_the_scripts_fit(said: list[str]) -> None:
    assert [line for line in said if "/wrong" not in line] == []


@needs_tsc
@pytest.mark.parametrize("n", range(len(WRONG)))
def test_what_does_not_fit_is_told(n: int, said: list[str]) -> None:
    (line,) = (line for line in said if f"/wrong{n}.js(" in line)
    assert list(WRONG.values())[n] in line


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The scripts as modules for node, with what the process of the pages packs for them."""
    folder = tmp_path_factory.mktemp("scripts")
    shutil.copytree(ASSETS, folder / "assets")
    (folder / "package.json").write_text('{"type": "module"}')
    for name in PURE:
        shutil.copy(SCRIPTS / name, folder)
    low = np.array([[1e6, 1e6 + 1, 1e6 - 2.5], [0.0, 1.0, 0.0]])
    data = ScopeData(5_000_000_000, 250, 3, low, low + 0.5)
    keys = ["bar.position", "bar.MOV"]
    (folder / "frame.bin").write_bytes(frame({"now": 7}, keys, [(1.0, 2.0), (None, None)], data))
    told = {"begin": data.begin, "width": data.width, "columns": data.columns, "keys": keys}
    (folder / "frame.json").write_text(json.dumps({**told, "low": data.low.tolist(), "high": data.high.tolist()}))
    for n in range(1, 9):
        name = "abcdefgh"[:n]
        (folder / f"file-{name}.bin").write_bytes(packed({"file": name}, [f"what is in {name}".encode()]))
    return folder


@needs_node
@pytest.mark.parametrize("name", PURE)
def test_what_knows_no_page_does_as_it_should(name: str, place: Path) -> None:
    done = subprocess.run(["node", "--test", name], cwd=place, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "# fail 0" in done.stdout or "fail 0" in done.stdout


def test_what_knows_no_page_asks_for_none() -> None:
    """The modules that say so name neither the page nor what it shares."""
    pure = [path for path in ASSETS.glob("*.js") if "Knows no page." in path.read_text(encoding="utf-8")]
    assert len(pure) >= 4
    for path in pure:
        text = path.read_text(encoding="utf-8")
        assert not {word for word in ("document", "window", "detent.", "location") if word in text}, path.name
