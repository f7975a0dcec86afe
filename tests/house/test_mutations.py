"""The list of mutations (make mutants) is true of the code: each text occurs once, each test exists."""

from collections import Counter

import pytest
from mutants import run

LEAST = 60

ENTRIES = run.entries()


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda e: f"{e['file']}: {' '.join(e['old'].split())[:60]}")
def test_the_text_occurs_once_and_the_tests_exist(entry):
    assert (run.ROOT / entry["file"]).read_text().count(entry["old"]) == 1
    assert entry["new"] != entry["old"]
    assert entry["tests"] and all((run.ROOT / name).exists() for name in entry["tests"])


def test_every_kernel_and_most_rooms_have_mutations():
    assert len(ENTRIES) >= LEAST
    files = {e["file"] for e in ENTRIES}
    kernels = {f"kernels/{p.name}" for p in (run.ROOT / "kernels").glob("*.cl")}
    assert not {k for k in kernels if k not in files}
    rooms = Counter(name.split("/")[1] for name in files if name.startswith("sarcl/"))
    assert len(rooms) >= 10
