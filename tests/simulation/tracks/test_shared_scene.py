"""Results that a scene keeps for later echoes: freed with it, within max_bytes, right after a fork."""

from __future__ import annotations

import gc
import os
import pickle
import weakref

import numpy as np
import pytest

import sarcl
from sarcl import shapes

CHIRP = sarcl.Waveform.chirp(center=5e9, bandwidth=150e6, duration=1e-6)
TRACK = sarcl.Trajectory.circle(radius=5e3, height=3e3, arc=0.01, n_pulses=6)
AXIS = np.linspace(-1, 1, 4)


def scene():
    ground = sarcl.Scene.from_heights(AXIS, AXIS, np.zeros((4, 4)), material="dry soil", point_roughness=0.02)
    return ground + shapes.box((2.0, 1.0, 0.5), position=(0, 0, 0.5))


def echo(of, **options):
    return sarcl.echo(of, CHIRP, TRACK, **{"tolerance": 1e-2, "check": False} | options).samples


def test_repeated_calls_share_results_and_have_equal_bits():
    shared = scene()
    first = echo(shared)
    assert shared.kept.nbytes > 0 and shared.realized(0) is shared.realized(0)
    assert np.array_equal(echo(shared), first) and np.array_equal(echo(scene()), first)
    other = echo(shared, seed=1)
    assert not np.array_equal(other, first)
    assert np.array_equal(other, echo(scene(), seed=1)) and np.array_equal(echo(shared), first)


def test_what_is_kept_is_freed_with_the_scene():
    shared = scene()
    echo(shared)
    moved = weakref.ref(shared.realized(0))
    assert moved() is not None
    del shared
    gc.collect()
    assert moved() is None


@pytest.mark.parametrize("most", [1e6, 8e6, None])
def test_no_more_is_kept_than_max_bytes_allow(most):
    shared = scene()
    small = echo(shared, max_bytes=most)
    if most is not None:
        assert shared.kept.nbytes <= most / 16
    assert np.linalg.norm(small - echo(scene())) <= 1e-6 * np.linalg.norm(small)
    assert np.array_equal(echo(shared, max_bytes=most), small)


def test_the_oldest_results_go_first_and_arrays_are_read_only():
    kept = shapes.box((1, 1, 1)).kept
    kept.limit(2000)
    for name in "abc":
        kept.of(name, lambda: [np.zeros(100)])
    assert kept.nbytes == 1600
    assert kept.of("b", lambda: None) is not None and kept.of("a", lambda: "computed again") == "computed again"
    with pytest.raises(ValueError, match="read-only"):
        kept.of("c", list)[0][0] = 1
    kept.limit(0)
    assert kept.nbytes == 0


def test_copies_and_pickles_begin_without_results():
    shared = scene()
    echo(shared)
    copy = pickle.loads(pickle.dumps(shared))
    assert copy.kept.nbytes == 0 and np.array_equal(echo(copy), echo(shared))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_uses_the_scene_as_its_parent_does():
    shared = scene()
    wanted = shared.realized(0).triangles.copy()
    echo(shared)
    child = os.fork()
    if child == 0:
        right = np.array_equal(shared.realized(0).triangles, wanted) and not np.array_equal(
            shared.realized(1).triangles, wanted
        )
        os._exit(0 if right else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert np.array_equal(echo(shared), echo(scene()))
