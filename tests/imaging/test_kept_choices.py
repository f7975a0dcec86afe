"""Choices of the method, and norms of rows, are kept for the same echoes, and made again for anything else."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.base.errors import ToleranceUnreachable
from sarcl.blocks.bands import LEAST_BYTES, pages_in_use
from sarcl.imaging import row_norms
from sarcl.imaging.choose_method import choose
from sarcl.imaging.direct import direct
from sarcl.imaging.focusing_task import make_task
from sarcl.imaging.kept_results import MOST
from sarcl.imaging.method_choice import STEPS
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
    for n in range(MOST):
        chosen(raw, tolerance=2e-2 + 1e-3 * n)
    gc.collect()
    assert first() is None
    last, echoes = weakref.ref(chosen(raw)), weakref.ref(raw)
    del raw
    gc.collect()
    assert last() is None and echoes() is None


@pytest.mark.parametrize("lazy", [False, True])
def test_other_samples_of_the_same_geometry_follow_the_same_plan(lazy, monkeypatch):
    raw, planned, make_plan = noise_history(seed=3), [], direct.make_plan
    monkeypatch.setattr(direct, "make_plan", lambda *wanted: planned.append(wanted) or make_plan(*wanted))
    looks = [raw, *(replace(raw, samples=s) for s in (7 * raw.samples, np.roll(raw.samples, 1, axis=0)))]
    if lazy:
        looks = [replace(look, samples=LazyRows(look)) for look in looks]
    choices = [chosen(look) for look in looks]
    assert len({id(choice.plan) for choice in choices}) == 1 and len(planned) == 1
    assert all(choice.predicted_error <= 1e-2 for choice in choices)
    image = sarcl.backproject(looks[1], plane(), tolerance=1e-2, check=True, device="cpu")
    assert image.report.measured_error <= image.report.predicted_error
    assert chosen(replace(raw, tx=raw.tx + 1.0)).plan is not choices[0].plan
    assert chosen(raw, tolerance=9.8e-3).plan is not choices[0].plan and len(planned) == 3


def test_a_tolerance_that_only_the_exact_one_meets_is_planned_for_it(monkeypatch):
    raw, planned, make_plan = noise_history(seed=4), [], direct.make_plan
    monkeypatch.setattr(direct, "make_plan", lambda *wanted: planned.append(wanted[1]) or make_plan(*wanted))
    chosen(raw)

    def refusing(task, tolerance, devices):
        planned.append(tolerance)
        if len(planned) == 2:
            raise ToleranceUnreachable(tolerance, None, "a stub", "")
        return make_plan(task, tolerance, devices)

    monkeypatch.setattr(direct, "make_plan", refusing)
    assert chosen(replace(raw)).plan.predicted_error <= planned[2]
    rounded, again, exact = planned
    assert rounded == again < exact < 1e-2 and exact / rounded < 1 + 2 / STEPS


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


@pytest.mark.parametrize("kind, rows", [(np.complex64, 4), (np.complex128, 4), (np.complex64, 10)])
def test_pages_are_used_without_a_change_of_values(kind, rows, monkeypatch):
    monkeypatch.setenv("SARCL_THREADS", "4")  # of which two use the pages of the largest
    values = np.resize(np.arange(1000, dtype=kind), (rows, LEAST_BYTES // 8))
    before = values.copy()
    with pages_in_use(SimpleNamespace(is_cpu=False), values, slice(1, rows - 1)):
        pass
    assert np.array_equal(values, before)


class Task(SimpleNamespace):
    """What row_norms reads of a FocusingTask."""

    __hash__ = object.__hash__


@pytest.mark.parametrize("scale", [1.0, 1e-38, 1e30, 0.0, 1e-200, 1e200])
@pytest.mark.parametrize("shape", [(70, 2000), (3, 70_000), (100, 3)])
def test_norms_of_rows_are_those_of_weighted_samples_of_any_size(scale, shape):
    random = np.random.default_rng(1)
    kind = np.complex64 if 1e-40 < scale < 1e40 else np.complex128
    unit = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    samples, along = (unit * scale).astype(kind), random.uniform(0, 2, shape[0])
    raw = SimpleNamespace(
        n_rows=shape[0], n_samples=shape[1], samples=None, read=lambda start, stop: samples[start:stop]
    )
    tiny = 2e-6 if scale == 1e-38 else 1e-7 if kind == np.complex64 else 1e-14  # roundings of the samples themselves
    for across in (random.uniform(0, 2, shape[1]), np.full(shape[1], 0.3)):
        norms = row_norms.row_norms(Task(raw=raw, sample_weight=across, row_weight=along))
        wanted = scale * along * np.linalg.norm(unit * across, axis=1)
        np.testing.assert_allclose(norms, wanted, rtol=tiny)


@pytest.mark.parametrize("window", [None, "hamming"])
def test_norms_by_several_threads_are_those_by_one(monkeypatch, window):
    norms = []
    for threads in ("1", "3"):
        monkeypatch.setenv("SARCL_THREADS", threads)
        raw = noise_history(n_rows=3001, n_samples=1100)  # what several threads read
        norms.append(row_norms.row_norms(make_task(raw, plane(), window, None, False, True)))
    assert np.array_equal(*norms) and norms[0].all()


def test_norms_are_kept_with_samples_that_cannot_change_for_each_window(monkeypatch):
    raw, reads, read = noise_history(), [], sarcl.PhaseHistory.read
    monkeypatch.setattr(sarcl.PhaseHistory, "read", lambda *rows: reads.append(rows) or read(*rows))

    def norms_of(raw, window=None, grid=None):
        return row_norms.row_norms(make_task(raw, grid or plane(), window, None, False, True))

    first = norms_of(raw)
    assert np.array_equal(norms_of(raw, grid=plane(0.1)), first) and len(reads) == 1
    assert (norms_of(raw, "hamming") < first).all() and np.array_equal(norms_of(raw), first) and len(reads) == 2
    assert np.array_equal(norms_of(replace(raw, samples=2 * raw.samples)), 2 * first) and len(reads) == 3
    writable(raw.samples)[:] *= 3
    assert np.allclose(norms_of(raw), 3 * first) and len(reads) == 4


@pytest.mark.parametrize("window", [None, "hamming"])
def test_no_weighted_sample_exceeds_the_largest_one(window):
    raw = noise_history()
    task = make_task(raw, plane(), window, None, False, True)
    largest = np.abs(raw.samples * task.sample_weight).max()
    assert largest <= row_norms.largest_sample(task) <= 1.01 * np.sqrt(raw.n_samples) * largest
    lazy = replace(raw, samples=LazyRows(raw))
    assert row_norms.largest_sample(make_task(lazy, plane(), window, None, False, True)) is None


def test_the_largest_sample_is_that_of_all_rows_where_norms_of_some_are_read():
    raw = SimpleNamespace(samples=noise_history().samples, n_rows=3, n_samples=2**28, largest_part=5.0)
    task = Task(raw=raw, sample_weight=np.array([1.0, 2.0]))
    assert row_norms.largest_sample(task) == pytest.approx(np.sqrt(2) * 5 * 2)


class LazyRows:
    """Samples that are read row by row, as of a file."""

    def __init__(self, raw):
        self.samples, self.shape, self.dtype = raw.samples, raw.shape, raw.dtype

    def __getitem__(self, rows):
        return self.samples[rows]
