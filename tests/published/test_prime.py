"""The aircraft PRIME of the Austin RCS benchmark, ducts closed: two wavelengths long, fins thin at their ends."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.austin_meshes import aircraft

import sarcl

CHIRP = sarcl.Waveform.chirp(center=37e6, bandwidth=6e6, duration=1e-6)
TRACK = sarcl.Trajectory(None, 1e3 * np.array([[0.853, 0.492, 0.174]]))
CELLS = 105


@pytest.fixture(scope="module")
def body(request):
    return aircraft(request.getfixturevalue("data_folder"))


def test_it_is_planned_with_cells_that_leave_strips_of_a_tenth_of_a_wavelength(body):
    assert np.allclose(body.bounds[1] - body.bounds[0], [15.056, 14.803, 3.127], atol=1e-3)
    said = sarcl.plan(sarcl.fullwave_echo, body, CHIRP, TRACK, cells=CELLS, anchors=1).plan["strips"]
    assert said.endswith("m^2 thinner than a cell, as sheets") and 1 < float(said.split()[0]) < 20
    for cells in (12, 40):
        with pytest.raises(ValueError, match="too thin for cells of"):
            sarcl.plan(sarcl.fullwave_echo, body, CHIRP, TRACK, cells=cells, anchors=1)


@pytest.mark.slow
def test_it_runs_and_states_its_error(body):
    """Two minutes on two idle cores. Error from a run with cells of 1.5 times the size, of first order."""
    raw = sarcl.fullwave_echo(body, CHIRP, TRACK, cells=CELLS, anchors=1)
    assert raw.report.plan["left"] < 2e-3 and 0.02 < raw.report.model_error < 1
    assert 1 < np.abs(np.asarray(raw.samples)).mean() < 10
