"""The YAML reader: YAML 1.2 scalars, places, limits and one clear error for each bad file."""

import contextlib
import io
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fzcli.errors import SpecError
from fzcli.spec.compose import MAX_DEPTH
from fzcli.spec.reader import dump, read, read_text


def fails(text: str) -> str:
    with pytest.raises(SpecError) as caught:
        read_text(text, "x.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("OFF", "OFF"),
        ("on", "on"),
        ("yes", "yes"),
        ("'1'", "1"),
        ("1e-3", 0.001),
        ("1e-8", 1e-8),
        (".5", 0.5),
        ("-1.", -1.0),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("0o17", 15),
        ("0x1F", 31),
        ("010", 10),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2001-01-01", "2001-01-01"),
        ("-.inf", -math.inf),
        ("3-4-5", "3-4-5"),
        ("10 ms", "10 ms"),
        ("+12", 12),
        ("e5", "e5"),
    ],
)
def test_plain_scalars_follow_the_core_schema(text: str, value: object) -> None:
    got = read_text(f"a: {text}").value["a"]
    assert got == value
    assert type(got) is type(value)


def test_keys_are_text() -> None:
    assert read_text("ON: 1\n2: x\nnull: y\n").value == {"ON": 1, "2": "x", "null": "y"}


def test_every_value_has_its_place() -> None:
    document = read_text("a:\n  - x\n  - {b: 'q', c: [1,\n     2]}\nd: |\n    if text\n", "x.yaml")
    assert document.place(("a", 0)) == (2, 5)
    assert document.place(("a", 1, "b")) == (3, 9)
    assert document.place(("a", 1, "c", 1)) == (4, 6)
    assert document.place(("a", 1, "nowhere", "deep")) == (3, 5)
    assert document.text_place(("a", 1, "b")) == (3, 10)
    assert document.text_place(("d",)) == (6, 5)
    assert document.problem("is odd", ("a", 1, "c", 1)).snippet == "         2]}\n         ^"


def test_list_items_with_a_name_are_called_by_it() -> None:
    document = read_text("links:\n- {name: a, mass: 1}\n- {name: a.b, mass: 2}\n- {mass: 3}\n")
    assert document.field(("links", 0, "mass")) == "links.a.mass"
    assert document.field(("links", 1, "mass")) == "links.1.mass"
    assert document.field(("links", 2, "mass")) == "links.2.mass"


def test_long_lines_are_cut_around_the_caret() -> None:
    document = read_text("[" + "1, " * 200 + "x]")
    line, caret = document.problem("odd", (200,)).snippet.split("\n")
    assert len(line) <= 104
    assert line[len(caret) - 1] == "x"


def test_aliases_are_written_out() -> None:
    value = read_text("a: &x {b: [1]}\nc: *x\n").value
    assert value["c"] == {"b": [1]}
    assert value["c"] is not value["a"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x.yaml: is empty"),
        ("# only a comment\n", "x.yaml: is empty"),
        ("---\n", "x.yaml: is empty"),
        ("a: 1\nb: 2\na: 3\n", "x.yaml:3:1: key 'a' stands twice in one mapping, first in line 1"),
        ("a: &x [1, *x]\n", "x.yaml:1:11: alias *x lies inside its own anchor: a cycle"),
        ("a: *x\n", "x.yaml:1:4: alias *x has no anchor &x before it"),
        ("a: !!python/name:os 1\n", "x.yaml:1:4: tags such as !!python/name:os are not read here; remove it"),
        ("a: !mine 1\n", "x.yaml:1:4: tags such as !mine are not read here; remove it"),
        ('scene:\n  - {name: "po\\0st"}\n', "x.yaml:2:12: holds a NUL character; no text may"),
        ('"a\\0b": 1\n', "x.yaml:1:1: holds a NUL character; no text may"),
        ("a: &b {c: 1}\nd: {<<: *b}\n", "x.yaml:2:5: merge keys (<<) are not YAML 1.2; write the keys out"),
        ("a: 1\n---\nb: 1\n", "x.yaml:2:1: a second document starts here; put it into its own file"),
        ("? [a]\n: 1\n", "x.yaml:1:3: a key must be one word or number, not a list or a mapping"),
        ("[" * 65 + "]" * 65, f"x.yaml:1:65: nested more than {MAX_DEPTH} levels deep"),
        ("a: " + "9" * 500, "x.yaml:1:4: a number of 500 characters is too long"),
        (
            "a: [1, 2\n",
            "x.yaml:2:1: not YAML: did not find expected ',' or ']' while parsing a flow sequence",
        ),
    ],
)
def test_bad_text_is_one_clear_error(text: str, message: str) -> None:
    assert fails(text).split("\n")[0] == message


def test_all_structural_problems_come_at_once() -> None:
    assert [line for line in fails("a: !x 1\na: 2\n<<: 3\n").split("\n") if line.startswith("x.yaml")] == [
        "x.yaml:1:4: tags such as !x are not read here; remove it",
        "x.yaml:2:1: key 'a' stands twice in one mapping, first in line 1",
        "x.yaml:3:1: merge keys (<<) are not YAML 1.2; write the keys out",
    ]


def test_a_bomb_of_aliases_is_refused_by_its_expanded_size() -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    assert "more than 100000 values, aliases written out" in fails("\n".join(lines))


def test_aliases_do_not_hide_depth() -> None:
    lines = ["a0: &a0 [1]", *(f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 70))]
    assert "nested more than 64 levels deep" in fails("\n".join(lines))


def test_a_very_deep_text_is_refused_at_once() -> None:
    assert "nested more than 64 levels deep" in fails("[" * 1_000_000)


def test_many_plain_values_are_refused() -> None:
    assert "more than 100000 values" in fails("[" + "1," * 100_001 + "]")
    assert len(read_text("[" + "1," * 99_000 + "]").value) == 99_000


def message_of(path: Path | str) -> str:
    with pytest.raises(SpecError) as caught:
        read(path)
    return str(caught.value)


def test_bad_files(tmp_path: Path) -> None:
    assert message_of(tmp_path / "none.yaml") == f"{tmp_path}/none.yaml: no such file"
    assert message_of(tmp_path) == f"{tmp_path}: is a directory; name a file in it"
    assert message_of("a\0b") == "a\0b: cannot be read: embedded null byte"
    file = tmp_path / "x.yaml"
    for data, message in (
        (b"", "is empty"),
        (b"\x89HDF\r\n\x1a\n\0\0", "is a binary file, not YAML text"),
        (b"a: 1\nb: \xff\xfe", "is not UTF-8 text (byte 8)"),
        (b"a: " + b"x" * 10_000_001, "is larger than 10 MB"),
        (b"a: \x01", "not YAML: control characters are not allowed"),
    ):
        file.write_bytes(data)
        head, _, text = message_of(file).partition(": ")
        assert head.startswith(str(file))
        assert text == message


def test_a_byte_order_mark_and_windows_line_ends_are_fine(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: 2\r\n")
    assert read(file).value == {"a": 1, "b": 2}
    assert read(file).place(("b",)) == (2, 4)


def test_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"a: 1\n")))
    document = read("-")
    assert (document.value, document.file, document.path) == ({"a": 1}, "<stdin>", None)


TEXT = st.characters(codec="utf-8", exclude_characters="\0")
LEAVES = (
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats(allow_nan=False)
    | st.text(TEXT, max_size=12)
    | st.sampled_from(
        ["ON", "off", "1e-3", "0x1f", "0o7", "<<", "~", "null", ".inf", "3-4-5", " x", "a: b", "#"]
    )
)


@given(
    st.recursive(
        LEAVES,
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(TEXT, max_size=5), inner, max_size=4),
    )
)
def test_dump_is_read_back_exactly(value: object) -> None:
    back = read_text(dump({"v": value})).value["v"]
    assert back == value
    assert repr(back) == repr(value)


def test_dump_keeps_the_order_and_writes_tuples_as_lists() -> None:
    assert dump({"b": (1, 2.5), "a": {"c": "OFF", "d": "1e-3", "e": 1e-08}}) == (
        "b: [1, 2.5]\na: {c: OFF, d: '1e-3', e: 1e-08}\n"
    )


@given(st.text(max_size=60) | st.text("{}[],:-?&*!|>'\"%@`# \n\tab1", max_size=40))
def test_any_text_is_a_document_or_a_spec_error(text: str) -> None:
    with contextlib.suppress(SpecError):
        read_text(text)
