"""A function of each part by several threads: in order, with the first error; by one thread where one is allowed."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from sarcl.base.threads import copy, of_each, threads


def test_results_come_in_the_order_of_the_parts(monkeypatch):
    monkeypatch.setenv("SARCL_THREADS", "3")
    meeting = threading.Barrier(3, timeout=20)  # passes where three threads run at the same time

    def square(part):
        meeting.wait()
        return part**2, threading.get_ident()

    made = of_each(square, [3, 1, 2])
    assert [value for value, _ in made] == [9, 1, 4]
    assert len({thread for _, thread in made}) == 3 and threading.get_ident() not in {thread for _, thread in made}
    assert of_each(square, []) == []


def test_one_thread_is_the_callers(monkeypatch):
    monkeypatch.setenv("SARCL_THREADS", "1")
    assert threads() == 1
    assert set(of_each(lambda part: threading.get_ident(), range(4))) == {threading.get_ident()}


@pytest.mark.parametrize("allowed", ["1", "2"])
def test_an_error_in_a_part_is_raised(monkeypatch, allowed):
    monkeypatch.setenv("SARCL_THREADS", allowed)
    with pytest.raises(ZeroDivisionError):
        of_each(lambda part: 1 / part, [1, 0, 2])


@pytest.mark.parametrize("shape", [(), (3,), (5, 2**18 + 3), (1, 2**22), (2**22 + 1,)])
def test_a_copy_has_all_values_whatever_threads_share_it(monkeypatch, shape):
    monkeypatch.setenv("SARCL_THREADS", "3")
    source = np.random.default_rng(0).standard_normal(shape)
    target = np.zeros_like(source)
    copy(source, target)
    assert np.array_equal(source, target)
    copy(source.T, target.T)
    assert np.array_equal(source, target)
