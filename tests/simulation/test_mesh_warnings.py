"""A mesh that is too coarse is warned of once per run."""

from __future__ import annotations

import functools
import warnings

import numpy as np
import pytest
from helpers.facet_cases import seen_from, still

import sarcl
from sarcl.base.errors import warn, warned_once

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=1e8, duration=1e-6)
BALL = sarcl.shapes.sphere(0.5, facets=300)
ARRAY = sarcl.AntennaArray.linear(4, spacing=0.015)


def messages(run):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        run()
    return [str(one.message) for one in found if issubclass(one.category, sarcl.SarclWarning)]


@pytest.mark.parametrize("verb", [sarcl.echo, functools.partial(sarcl.plan, sarcl.echo)])
@pytest.mark.parametrize(
    "options",
    [{"polarization": "all"}, {"array": ARRAY, "channels": "separated", "receive": "all"}],
    ids=["all polarisations", "array"],
)
def test_once_per_run(verb, options):
    track = still(*(seen_from(1e4, 0.8, a) for a in np.linspace(0, 0.01, 8)))
    found = messages(lambda: verb(BALL, CHIRP, track, tolerance=1e-2, shadows=False, **options))
    assert len(found) == 1 and "too coarse for the wavelength" in found[0]


@pytest.mark.parametrize("verb", [sarcl.echo, functools.partial(sarcl.plan, sarcl.echo)])
def test_a_list_of_tracks_is_warned_of_once_with_their_number(verb):
    tracks = [still(*(seen_from(1e4, 0.8, b + a) for a in np.linspace(0, 0.01, 8))) for b in (0.0, 0.5, 1.0)]
    found = messages(lambda: verb(BALL, CHIRP, tracks, tolerance=1e-2, shadows=False, polarization="all"))
    assert len(found) == 1 and "too coarse" in found[0] and found[0].endswith("(and so of 2 more tracks)")
    assert "more tracks" not in messages(lambda: verb(BALL, CHIRP, tracks[:1], tolerance=1e-2, shadows=False))[0]


def test_a_topic_is_warned_of_once_and_then_anew():
    def twice():
        with warned_once():
            warn("about 1 dB", "level")
            with warned_once():
                warn("about 2 dB", "level")
            warn("another text")

    assert messages(twice) == ["about 1 dB", "another text"]
    assert messages(twice) == ["about 1 dB", "another text"]
    assert messages(lambda: [warn("same") for _ in range(2)]) == ["same", "same"]
