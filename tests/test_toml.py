"""TOML is read in time that grows with the text, and refused in a line of words."""

import contextlib
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.test_assembler_bounds import lines_executed

from detent import toml

LONG = "a." * 3000 + "b"
KEYS = {
    "a key": f"{LONG} = 1",
    "a key with blanks": f"  {LONG.replace('.', ' . ')} = 1",
    "a table": f"[{LONG}]",
    "a list of tables": f"[[ {LONG} ]]",
    "in a table of a line": f"x = {{ y = 1, {LONG} = 1 }}",
    "of words in quotes": "\"a\".'b'." * 2000 + "c = 1",
}


@pytest.mark.parametrize("kind", KEYS)
def test_a_key_of_very_many_parts_is_refused_at_once(kind: str) -> None:
    text = "title = 'x'\n" + KEYS[kind]

    def read() -> None:
        with contextlib.suppress(toml.NoToml):
            toml.loads(text)

    assert lines_executed(read) < 2000
    with pytest.raises(toml.NoToml, match=r"a key of more than 20 parts \(at line 2\)"):
        toml.loads(text)


def test_what_is_no_key_may_have_any_number_of_dots() -> None:
    dots = "a." * 300
    text = f'title = "{dots}"\nnumber = 1.5\n# {dots}\nlist = ["{dots}", "x"]\n[a.b.c]\nd.e = {{f.g = 1}}\n'
    assert toml.loads(text)["a"]["b"]["c"]["d"]["e"]["f"]["g"] == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [("= 1", "it is no TOML: "), ("x = " + "[" * 9000, "nested too deeply"),
     ("x = " + "9" * 5000, "thousands of digits"), ('x = "' + "y" * 9000, "it is no TOML: ")],
)  # fmt: skip
def test_an_error_is_a_line(text: str, words: str) -> None:
    with pytest.raises(toml.NoToml, match=words) as raised:
        toml.loads(text)
    assert len(str(raised.value)) < 700
    assert "\n" not in str(raised.value)


@given(st.text())
def test_every_text_is_read_as_it_was_written(text: str) -> None:
    line = toml.written(text)
    assert tomllib.loads(f"x = {line}")["x"] == text
    assert "\n" not in line
    assert "\r" not in line
