"""Functions without a kernel equal their references in sarcl/reference (kernels are tested elsewhere)."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl
from sarcl.reference.equations import matched_filter
from sarcl.reference.image import multilook


def test_compress_equals_its_twin():
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
    raw = noise_history(n_rows=4, n_samples=9, waveform=chirp, compressed=False)
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(9)
    wanted = matched_filter(raw.samples, chirp.pulse_spectrum(frequencies))
    assert sarcl.compress(raw).samples == pytest.approx(wanted, rel=1e-6)  # complex64


@pytest.mark.parametrize("looks", [(1, 1), (2, 3), (4, 1), (7, 5)])
def test_multilook_equals_its_twin(looks):
    random = np.random.default_rng(0)
    data = (random.standard_normal((7, 11)) + 1j * random.standard_normal((7, 11))).astype(np.complex64)
    image = sarcl.Image(data, sarcl.ImageGrid.plane(shape=data.shape, spacing=0.5))
    assert image.multilook(looks).data == pytest.approx(multilook(data, looks), rel=1e-5)  # float32 means
