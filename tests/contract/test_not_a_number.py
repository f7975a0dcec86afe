"""NaN anywhere in a result never passes its check, in any verb; a result of zeros has the error 0."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base import errors
from sarcl.base.report import Report
from sarcl.blocks.fill_bands import BandFiller
from sarcl.model.image import Image
from sarcl.opencl.device import Device
from sarcl.scene import shapes
from sarcl.simulation.echo_output import EchoOutput

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(-5e3, -25.6, 3e3), velocity=(0, 100, 0), prf=500.0, n_pulses=256)
POINTS = sarcl.Scene.points([[0.0, 0.0, 0.0], [2.0, 1.0, 0.0]], [1.0, 2.0])
GRID = sarcl.ImageGrid.plane(shape=(40, 40), spacing=0.2)
FOCUS = {"backproject": lambda raw, **o: sarcl.backproject(raw, GRID, **o),
         "polar_format": lambda raw, **o: sarcl.polar_format(raw, GRID, tolerance=1e-1, **o),
         "range_doppler": lambda raw, **o: sarcl.range_doppler(raw, side="right", **o)}  # fmt: skip


def passing(n=8):
    return sarcl.Trajectory.line(start=(-30.0, -0.2, 20.0), velocity=(0, 1, 0), prf=20.0, n_pulses=n)


ECHOES = {
    "echo": lambda **o: sarcl.echo(POINTS, CHIRP, TRACK, **o),
    "echo of an array": lambda **o: sarcl.echo(
        POINTS, CHIRP, passing(), array=sarcl.AntennaArray.linear(3, spacing=0.015, frequency_step=1e6), **o
    ),
    "spectral_echo": lambda **o: sarcl.spectral_echo(POINTS, CHIRP, TRACK, **o),
    "fullwave_echo": lambda **o: sarcl.fullwave_echo(
        shapes.box((0.1, 0.1, 0.1)), sarcl.Waveform.chirp(center=1e9, bandwidth=1e8, duration=1e-8), passing(4),
        anchors=2, model_error=False, **o,
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def raw():
    return sarcl.echo(POINTS, CHIRP, TRACK, tolerance=1e-3)


@pytest.fixture
def broken(monkeypatch):
    """Devices whose first complex value of every download is NaN."""
    download = Device.download

    def with_nan(self, *arguments, **options):
        values = download(self, *arguments, **options)
        if np.iscomplexobj(values):
            values[(0,) * values.ndim] = np.nan
        return values

    monkeypatch.setattr(Device, "download", with_nan)


@pytest.fixture(params=["one sample", "all samples"])
def broken_echoes(monkeypatch, request):
    """Echoes of which one sample, or every sample, is NaN when it is stored."""

    def storing(name):
        store = getattr(EchoOutput, name)

        def with_nan(self, start, block):
            block[(0,) * block.ndim if request.param == "one sample" else ...] = np.nan
            store(self, start, block)

        return with_nan

    for name in ("keep", "keep_frequencies"):
        monkeypatch.setattr(EchoOutput, name, storing(name))
    fill = BandFiller.fill

    def fill_with_nan(self, flat, runs=None):
        filled = fill(self, flat, runs)
        if runs is not None:  # of the grid: their rows are no samples
            return filled
        rows = slice(0, 1 if request.param == "one sample" else None)
        values = np.array(flat[rows])
        values[(0, 0) if request.param == "one sample" else ...] = np.nan
        flat[slice(0, len(values))] = values
        return filled

    monkeypatch.setattr(BandFiller, "fill", fill_with_nan)


@pytest.mark.parametrize("verb", FOCUS)
def test_images_with_nan_are_refused(raw, broken, verb):
    with pytest.raises(sarcl.ToleranceMissed, match=r"not finite numbers") as missed:
        FOCUS[verb](raw, check=True)
    assert np.isnan(missed.value.measured) and np.isnan(missed.value.image.data).any()


@pytest.mark.parametrize("verb", ECHOES)
def test_echoes_with_nan_are_refused(broken_echoes, verb):
    with pytest.raises(ValueError, match=r"samples\[.*every value must be finite"):
        ECHOES[verb](check=True)


@pytest.mark.parametrize("verb", ["echo", "spectral_echo", "fullwave_echo"])
def test_echoes_with_nan_in_a_file_are_refused(broken_echoes, verb, tmp_path):
    with pytest.raises(ValueError, match=r"not finite numbers|must be finite"):
        ECHOES[verb](check=True, out=tmp_path / "raw.h5")


@pytest.mark.parametrize("verb", FOCUS)
def test_images_of_zeros_are_exact(raw, verb):
    from dataclasses import replace

    image = FOCUS[verb](replace(raw, samples=np.zeros_like(raw.samples)), check=True)
    assert image.report.measured_error == 0 and not image.data.any()


def image_of(measured, data=(1.0,), predicted=9e-4):
    grid = sarcl.ImageGrid.points(np.zeros((len(data), 3)))
    report = Report(tolerance=1e-3, predicted_error=predicted, measured_error=measured)
    return Image(np.array(data, np.complex64), grid, gain=1.0, frequency=1e9, report=report)


@pytest.mark.parametrize("measured", [np.nan, np.inf, 1.1e-3])
def test_errors_that_are_no_numbers_are_above_every_tolerance(measured):
    with pytest.raises(sarcl.ToleranceMissed):
        errors.confirm_tolerance(image=image_of(measured))


@pytest.mark.parametrize("value", [np.nan, np.inf, complex(0, np.nan)])
def test_values_that_no_check_has_drawn_are_looked_at_too(value):
    errors.confirm_tolerance(image=image_of(1e-4, (1.0, 2.0)))
    errors.confirm_tolerance(image=image_of(None, (1.0, value)))  # not checked
    with pytest.raises(sarcl.ToleranceMissed, match=r"not finite numbers; use echo, and please report it"):
        errors.confirm_tolerance(image=image_of(1e-4, (1.0, value)), instead="use echo")


def test_a_smaller_tolerance_is_advised_only_where_the_predicted_terms_explain_the_error():
    with pytest.raises(sarcl.ToleranceMissed, match=r"ask for 2\.8e-04, and please"):
        errors.confirm_tolerance(image=image_of(1.8e-3), instead="use echo")
    with pytest.raises(sarcl.ToleranceMissed, match=r"may remain at a smaller tolerance; use echo, and please"):
        errors.confirm_tolerance(image=image_of(1.9e-3), instead="use echo")
