"""Choices of the method are kept for the same echoes, and made again for anything else; samples that cannot change."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.blocks.bands import LEAST_BYTES, pages_in_use
from sarcl.imaging.choose_method import MOST_CHOICES, choose
from sarcl.imaging.focusing_task import make_task
from sarcl.model.lazy_rows import is_constant
from sarcl.numerics.cost_model import CPU


def plane(spacing=0.2):
    return sarcl.ImageGrid.plane(shape=(40, 33), spacing=spacing)


def chosen(raw, grid=None, window=None, tolerance=1e-2, devices=CPU, **options):
    task = make_task(raw, grid or plane(), window, None, options.pop("wrap", False), True, **options)
    return choose(task, "direct", tolerance, devices)


def writable(array):
    """The same array, which may be written to."""
    array.flags.writeable = True
    return array


CHANGES = {
    "tolerance": lambda raw: chosen(raw, tolerance=1e-3),
    "devices": lambda raw: chosen(raw, devices=CPU._replace(lanes=False)),
    "window": lambda raw: chosen(raw, window="hamming"),
    "wrap": lambda raw: chosen(raw, wrap=True),
    "beam": lambda raw: chosen(raw, beam=0.5),
    "grid": lambda raw: chosen(raw, plane(0.1)),
    "other echoes": lambda raw: chosen(replace(raw, samples=2 * raw.samples)),
    "an antenna that was moved in place": lambda raw: (writable(raw.tx).__setitem__((3, 0), 7.0), chosen(raw))[1],
    "samples that may change": lambda raw: (writable(raw.samples), chosen(raw))[1],
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_choice_is_kept_for_equal_tasks_and_made_again_for_others(change):
    raw = noise_history()
    first = chosen(raw)
    assert chosen(raw) is first and chosen(raw, plane()) is first
    assert CHANGES[change](raw) is not first


def test_few_choices_are_kept_and_none_longer_than_the_echoes():
    raw = noise_history()
    first = weakref.ref(chosen(raw))
    for n in range(MOST_CHOICES):
        chosen(raw, tolerance=2e-2 + 1e-3 * n)
    gc.collect()
    assert first() is None
    last, echoes = weakref.ref(chosen(raw)), weakref.ref(raw)
    del raw
    gc.collect()
    assert last() is None and echoes() is None


def test_an_image_of_a_kept_choice_has_the_bits_of_the_first():
    raw = noise_history()
    first, second = (sarcl.backproject(raw, plane(), tolerance=1e-2, device="cpu") for _ in range(2))
    assert np.array_equal(first.data, second.data) and second.report.plan == first.report.plan


def test_an_array_is_constant_where_nobody_can_write_to_its_memory(tmp_path):
    free = np.ones((4, 6), np.complex64)
    view = free[:, :3]
    view.flags.writeable = False
    assert not is_constant(free) and not is_constant(view) and not is_constant(np.broadcast_to(free[0], (9, 6)))
    free.flags.writeable = False
    assert is_constant(free) and is_constant(free[1:]) and is_constant(np.frombuffer(bytes(8), np.complex64))
    assert not is_constant(np.frombuffer(bytearray(8), np.complex64)) and not is_constant([1j])
    free.tofile(tmp_path / "samples")
    assert not is_constant(np.memmap(tmp_path / "samples", np.complex64, "r"))


def test_samples_behind_a_view_are_looked_at_each_time_they_are_read():
    base = np.ones((6, 4), np.complex64)
    view = base[:]
    view.flags.writeable = False
    track = np.stack([np.zeros(6), np.arange(6.0), np.full(6, 9e3)], axis=1)
    raw = sarcl.PhaseHistory(view, frequency=9e9, frequency_step=1e6, tx=track, reference_range=9e3)
    base[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"samples\[2, 1\] is"):
        raw.read(0, 6)


def test_the_largest_part_is_known_of_samples_that_cannot_change():
    raw = noise_history()
    both = np.abs(np.stack([raw.samples.real, raw.samples.imag]))
    assert raw.largest_part == both.max()
    assert replace(raw, samples=-raw.samples).largest_part == raw.largest_part
    view = np.array(raw.samples)[:]
    view.flags.writeable = False
    assert replace(raw, samples=view[:]).largest_part is None


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
def test_pages_are_used_without_a_change_of_values(kind):
    values = np.random.default_rng(0).standard_normal((4, LEAST_BYTES // 8)).astype(kind)
    before = values.copy()
    with pages_in_use(SimpleNamespace(is_cpu=False), values, slice(1, 3)):
        pass
    assert np.array_equal(values, before)
