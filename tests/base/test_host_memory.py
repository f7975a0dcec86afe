"""Arrays that do not fit in memory are temporary files, which vanish with them."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import tempfile
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest

from sarcl.base import host_memory

Usage = namedtuple("Usage", "total used free")


def test_a_small_array_is_in_memory_and_a_large_one_in_a_file_without_a_name(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    small, large = (host_memory.zeros((30, 40), limit, "rows") for limit in (9600, 9599))
    assert not isinstance(small, np.memmap) and isinstance(large, np.memmap)
    for held in (small, large):
        assert held.dtype == np.complex64 and held.shape == (30, 40) and not held.any()
        held[3, 4] = 5j
        assert held[3, 4] == 5j and held.sum() == 5j
    del large
    assert list(tmp_path.iterdir()) == []


def test_a_full_folder_of_temporary_files_is_named_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: Usage(1e6, 1e6, 5000))
    with pytest.raises(MemoryError, match=r"rows need 9\.6 kB; 1 kB .* has 5 kB left: raise max_bytes, or set TMPDIR"):
        host_memory.zeros((30, 40), 1000, "rows")


def test_the_memory_of_this_machine_is_known_or_infinite(monkeypatch):
    assert host_memory.installed() > 2**28
    monkeypatch.delattr("os.sysconf", raising=False)
    assert host_memory.installed() == np.inf


def resident():
    """Resident bytes, whatever is free among them."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries keep what they like")
def test_freed_memory_between_arrays_in_use_goes_back_to_the_system():
    arrays = [np.ones(12_000) for _ in range(1000)]  # 96 kB each: of the heap, never maps of their own
    kept = arrays[::2]
    del arrays
    before = resident()
    host_memory.release(host_memory.LEAST_RELEASED - 1)
    assert resident() > before - 2**20
    host_memory.release(host_memory.LEAST_RELEASED)
    assert resident() < before - 500 * 80_000
    assert all((array == 1).all() for array in kept)


def test_other_c_libraries_have_nothing_to_release(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    host_memory.release(1e9)
