"""TOML written without loss, and the line of every key found."""

import math
import tomllib

import numpy as np
import pytest

from sarcl.io import toml
from sarcl.io.toml import locate


def test_floats_come_back_to_the_last_bit_and_strings_with_every_character():
    tables = {
        "a": {
            "floats": [0.1, 1e-300, -0.0, math.pi, 9.6e9, 5e-324, 1.7976931348623157e308, math.inf],
            "text": 'quote " backslash \\ tab \t newline \n bell \x07 delete \x7f ä 🛰',
            "flags": [True, False],
            "whole": 2**53 + 1,
            "empty": [],
            "nested": [[[1.5, 2]], [["x", {"deep key": 1}]]],
            "a key.with dots": 1,
            "long": list(np.linspace(0, 1, 100)),
        },
        "b": {"rows": [{"x": 1}, {"y": {"z": 2}}], "none": {}},
    }
    text = toml.dumps(tables)
    assert tomllib.loads(text) == tables
    assert math.copysign(1, tomllib.loads(text)["a"]["floats"][2]) == -1


def test_what_toml_cannot_say_is_refused():
    with pytest.raises(TypeError, match=r"a\.b\[1\] is a complex"):
        toml.dumps({"a": {"b": [1, 2j]}})


def test_lines_are_found_through_everything_toml_allows():
    text = '''\
# [comment]
top = 1  # = 2
"quoted.key" = """
[not.a.table] = "
x = 1 \\""" still """
a.b . "c d" = {x = [1, {y = 2}], 'z' = "}"}

[t]  # [[no]]
list = [ # ]
  [1, 2], # 3
  {deep = 'a#b'},
]
when = 1979-05-27 07:32:00Z
[[rows]]
x = 1
[rows.sub]
k = \'\'\'
\'\'\'
[[rows]]

x = 2
[ "\\u0061\\"b" . c ]
'''
    tomllib.loads(text)
    found = locate(text)
    for path, number in {
        ("top",): 2,
        ("quoted.key",): 3,
        ("a",): 6,
        ("a", "b", "c d"): 6,
        ("a", "b", "c d", "x", 1, "y"): 6,
        ("t",): 8,
        ("t", "list"): 9,
        ("t", "list", 1, "deep"): 11,
        ("t", "when"): 13,
        ("rows", 0): 14,
        ("rows", 0, "x"): 15,
        ("rows", 0, "sub", "k"): 17,
        ("rows", 1): 19,
        ("rows", 1, "x"): 21,
        ('a"b', "c"): 22,
    }.items():
        assert found[path] == number, path
    assert not any("not" in p or "no" in p for p in found)


def test_every_key_of_every_table_is_located():
    def walk(path, value):
        if isinstance(value, dict):
            for k, v in value.items():
                assert (*path, k) in found
                walk((*path, k), v)
        elif isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
            for i, v in enumerate(value):
                assert (*path, i) in found
                walk((*path, i), v)

    tables = {"a": {"b": [{"x": 1}, {"y": {"z": "]"}}]}, "c d": {"e": [[1, 2], [3]], "f": {}}, "g": {"h": ""}}
    found = locate(toml.dumps(tables))
    walk((), tables)


def test_integers_of_64_bits_are_read():
    text = f'a = {2**63 - 1}\nb = [{-(2**63)}, 0xff]\nc = "{"9" * 5000}"\nd = {"9" * 300}.0\n'
    assert toml.tables(text, "a.toml") == tomllib.loads(text)
