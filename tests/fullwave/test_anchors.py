"""Anchors: echoes between them, and their own estimate of the error, on targets whose currents are known everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from forming_cases import case

from sarcl.fullwave.anchors import ENOUGH, FIRST, LEAST, anchored


def error(got, own):
    return float(np.sqrt((np.abs(got - own) ** 2).sum() / (np.abs(own) ** 2).sum()))


def results(seeds, **options):
    """True errors, estimated errors and what was found, of random targets."""
    out = []
    for seed in seeds:
        _, along, formed, own = case(seed)
        got = anchored(lambda pulse, echoes=formed: echoes[pulse], along, **options)
        out.append((error(got.samples, own), got.predicted_error, got))
    true, predicted = np.array([row[:2] for row in out]).T
    return true, predicted, [row[2] for row in out]


def test_a_tolerance_is_kept_and_the_error_is_known():
    true, predicted, got = results((200, 201, 203, 207), tolerance=3e-2)
    assert true.max() < 0.04
    assert (predicted <= ENOUGH * 0.03).all()
    assert ((predicted > true / 2) & (predicted < 2 * true)).all()
    assert all(len(g.pulses) == len(g.checks) + len(FIRST) and len(g.pulses) >= LEAST for g in got)


@pytest.mark.slow
def test_over_many_targets_estimates_are_within_a_factor_of_two():
    """Errors below 0.2 % are left out: noise of float32."""
    for tolerance in (3e-2, 1e-2):
        true, predicted, got = results(range(300, 340), tolerance=tolerance)
        ratio = (predicted / true)[true > 2e-3]
        assert np.mean((ratio > 0.5) & (ratio < 2)) >= 0.8
        assert 0.7 < np.median(ratio) < 1.3
        assert np.quantile(true, 0.9) < tolerance
        found = np.array([check.predicted / check.found for g in got for check in g.checks if check.found > 2e-3])
        assert 0.7 < np.median(found) < 1.3


def test_more_anchors_for_a_smaller_tolerance():
    _, along, formed, own = case(201)
    got = [anchored(lambda pulse: formed[pulse], along, tolerance=tolerance) for tolerance in (0.1, 3e-2, 3e-3)]
    assert np.all(np.diff([len(g.pulses) for g in got]) >= 0) and len(got[2].pulses) > len(got[0].pulses)
    assert error(got[2].samples, own) < 3e-3
    assert [n for n, _ in got[2].history] == list(range(len(FIRST), len(got[2].pulses) + 1))


def test_one_anchor_is_waveform_forming_as_published():
    _, along, formed, _ = case(203)
    got = anchored(lambda pulse: formed[pulse], along, anchors=1)
    assert got.pulses.tolist() == [60] and np.isnan(got.predicted_error)
    assert np.array_equal(got.samples, formed[60])


def test_anchors_at_given_pulses_and_equispaced_ones():
    _, along, formed, own = case(204)
    got = anchored(lambda pulse: formed[pulse], along, anchors=np.array([5, 100, 40, 70]))
    assert got.pulses.tolist() == [5, 40, 70, 100]
    assert error(got.samples[got.pulses], own[got.pulses]) < 1e-5
    few, many = (error(anchored(lambda p: formed[p], along, anchors=n).samples, own) for n in (4, 14))
    assert len(anchored(lambda p: formed[p], along, anchors=14).pulses) == 14
    assert many < few / 3


def test_a_track_in_the_other_direction_gives_the_same_echoes():
    _, along, formed, _ = case(205)
    there = anchored(lambda pulse: formed[pulse], along, anchors=7)
    back = anchored(lambda pulse: formed[120 - pulse, ::-1], along[::-1], anchors=7)
    assert np.allclose(there.samples, back.samples[::-1], atol=1e-4 * np.abs(there.samples).max())


def test_a_mirror_adds_the_other_anchor_of_a_run():
    _, along, formed, _ = case(206)
    asked = []

    def run(pulse):
        asked.append(pulse)
        return formed[pulse]

    got = anchored(run, along, tolerance=1e-2, mirror=120 - np.arange(121))
    assert np.array_equal(np.sort(120 - got.pulses), got.pulses)
    assert all(120 - pulse in asked for pulse in asked) and len(asked) == len(set(asked))


def test_mirrored_anchors_beside_one_another_count_once():
    # of an even number of pulses, the mirror of the middle one is its neighbour: both would predict one another
    _, along, formed, own = case(206)
    even = slice(0, 120)
    got = anchored(lambda pulse: formed[pulse, even], along[even], tolerance=3e-2, mirror=119 - np.arange(120))
    assert np.diff(got.pulses).min() > 5
    assert error(got.samples, own[even]) < 3e-2


def test_directions_that_are_all_the_same_need_one_anchor():
    echoes = np.ones((3, 1, 2), np.complex64)
    got = anchored(lambda pulse: echoes, np.zeros(3))
    assert len(got.pulses) == 1 and got.predicted_error == 0 and np.array_equal(got.samples, echoes)


def test_a_target_without_echo_has_no_error():
    with np.errstate(all="raise"):
        got = anchored(lambda pulse: np.zeros((3, 1, 2), np.complex64), np.arange(3.0), anchors=1)
    assert got.predicted_error == 0 and not got.samples.any()


@pytest.mark.parametrize("anchors", ["auto", 4, np.arange(12)])
def test_a_track_that_hovers_has_one_anchor_per_direction(anchors):
    """Four places, three pulses at each; the second and third pulse of a place differ by rounding."""
    _, along, formed, own = case(208)
    some = np.repeat([10, 40, 70, 100], 3)
    asked = []

    def run(pulse):
        asked.append(pulse // 3)
        return formed[some[pulse]][some]

    got = anchored(run, along[some] + np.tile([0, 1e-15, 1e-9], 4), anchors=anchors, tolerance=1e-6)
    assert sorted(asked) == [0, 1, 2, 3] and len(got.pulses) == 4
    assert error(got.samples, own[some]) < 1e-4 and got.predicted_error < 1e-4


def test_few_pulses_become_anchors_all():
    _, along, formed, own = case(207)
    some = [0, 20, 60, 61, 119]
    got = anchored(lambda pulse: formed[some[pulse]][some], along[some], tolerance=1e-9)
    assert got.pulses.tolist() == list(range(5))
    assert error(got.samples, own[some]) < 1e-6
