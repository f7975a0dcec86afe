"""Norms of rows, by which errors of interpolation and rounding are related to the image."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sarcl.imaging import profile_energy


class Task(SimpleNamespace):
    """What row_norms reads of a FocusingTask."""

    __hash__ = object.__hash__


@pytest.mark.parametrize("scale", [1.0, 1e-38, 1e30, 0.0, 1e-200, 1e200])
@pytest.mark.parametrize("shape", [(70, 2000), (3, 70_000), (100, 3)])
def test_norms_of_rows_are_those_of_weighted_samples_of_any_size(scale, shape):
    random = np.random.default_rng(1)
    kind = np.complex64 if 1e-40 < scale < 1e40 else np.complex128
    unit = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    samples, across, along = (unit * scale).astype(kind), random.uniform(0, 2, shape[1]), random.uniform(0, 2, shape[0])
    raw = SimpleNamespace(n_rows=shape[0], n_samples=shape[1], read=lambda start, stop: samples[start:stop])
    found = profile_energy.row_norms(Task(raw=raw, sample_weight=across, row_weight=along))
    wanted = scale * along * np.linalg.norm(unit * across, axis=1)
    tiny = 2e-6 if scale == 1e-38 else 1e-7 if kind == np.complex64 else 1e-14  # roundings of the samples themselves
    np.testing.assert_allclose(found, wanted, rtol=tiny)
