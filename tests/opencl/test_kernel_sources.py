"""What every kernel file must be, so that compilers and drivers other than those at hand accept it too."""

import re
from pathlib import Path

import pytest

KERNELS = sorted(p for p in (Path(__file__).parents[2] / "kernels").iterdir() if p.suffix in (".cl", ".clh"))


@pytest.mark.parametrize("path", KERNELS, ids=lambda p: p.name)
def test_functions_are_static_inline(path):
    """Plain `inline` of C99 defines no function: Clang leaves it undefined where it decides not to inline it."""
    text = re.sub(r"//.*|#(?:define|undef) inline\b.*", "", path.read_text())
    assert not re.search(r"(?<!static )\binline\b", text)


@pytest.mark.parametrize("path", KERNELS, ids=lambda p: p.name)
def test_no_offset_of_a_vector_load_is_a_first_tap_which_may_be_negative(path):
    """vload2(j, row) takes j as size_t: a negative j relies on an overflow. row + 2 * j is a place before `row`."""
    text = re.sub(r"//.*", "", path.read_text())
    assert not re.search(r"\bv(load\d*|store\d*\(.*?,) *\(? *j\b", text)
