"""Thin sheets: what they reflect, what they let through, and what is seen behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT

THICKNESSES, FREQUENCIES = (1.5e-3, 10e-3), (2.58e9, 9.6e9)  # m, Hz
INCIDENCE = np.radians(np.arange(0.0, 71.0, 10.0))
GATE = 0.01  # dB
EPS = 3.0


def films(thickness, frequency, incidence, eps=EPS):
    """|R| and |T| of a film by its characteristic matrix, electric field across, then in the plane of incidence.

    Abeles: (B, C) = ((cos d, j sin d/Y), (j Y sin d, cos d)) (1, Y0), with Y0 and Y the admittances outside and inside.
    """
    c = np.cos(incidence)
    inside = np.sqrt(eps - np.sin(incidence) ** 2 + 0j)
    delta = 2 * np.pi * frequency / SPEED_OF_LIGHT * thickness * inside
    out = []
    for outer, inner in ((c, inside), (1 / c, eps / inside)):
        b = np.cos(delta) + 1j * np.sin(delta) * outer / inner
        d = 1j * inner * np.sin(delta) + np.cos(delta) * outer
        out.append((np.abs((outer * b - d) / (outer * b + d)), np.abs(2 * outer / (outer * b + d))))
    return out


def decibels(ratio):
    return 20 * np.log10(np.abs(ratio))


@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_a_sheet_reflects_and_transmits_as_a_film_does(thickness, frequency):
    """Beside a conducting plate: towards the mirror direction |R|, and straight behind it 1 - T."""
    elevation = np.pi / 2 - INCIDENCE
    sheet, metal = (shapes.plate((2, 2), material=m) for m in (sarcl.Material(EPS, thickness=thickness), "metal"))
    for receiver in ((np.pi, elevation), (np.pi, -elevation)):
        options = {"receiver": receiver, "polarization": ("HH", "VV"), "forward": True}
        s, whole = (sarcl.rcs(scene, 0.0, elevation, frequency, **options) for scene in (sheet, metal))
        for column, (reflected, transmitted) in enumerate(films(thickness, frequency, INCIDENCE)):
            share = s[:, column] / whole[:, column]
            if receiver[1][1] > 0:
                # at Brewster's angle, 60 deg, nothing is reflected
                assert np.abs(share) == pytest.approx(reflected, rel=10 ** (GATE / 20) - 1, abs=1e-12)
            else:
                assert decibels((1 - share) / transmitted) == pytest.approx(0, abs=GATE)


@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_what_lies_behind_is_seen_through_it_both_ways(thickness, frequency):
    """A plate behind a large sheet: its echo is that of the plate times T^2, with H and V each their own T."""
    elevation = np.pi / 2 - INCIDENCE
    sheet = shapes.plate((40.0, 40.0), material=sarcl.Material(EPS, thickness=thickness))
    ball = shapes.plate((0.3, 0.3), position=(0, 0, -1.0), rotation=(0, 0.5, 0))
    options = {"polarization": ("HH", "VV", "HV")}
    both, front, alone = (sarcl.rcs(s, 0.0, elevation, frequency, **options) for s in (sheet + ball, sheet, ball))
    for column, (_, transmitted) in enumerate(films(thickness, frequency, INCIDENCE)):
        behind = (both - front)[:, column] / alone[:, column]
        assert decibels(behind / transmitted**2) == pytest.approx(0, abs=GATE)
    assert np.abs((both - front)[:, 2]).max() < 1e-9 * np.abs(front).max()


def test_a_sheet_of_vacuum_changes_nothing_and_two_sheets_count_both():
    elevation, frequency = np.radians(60.0), 5e9
    plate = shapes.plate((0.3, 0.3), position=(0, 0, -1.0), rotation=(0, 0.5, 0))

    def seen(*materials):
        sizes = [(10, 10), (20, 20)]  # of the lower, and of an upper one before all of it
        sheets = [
            shapes.plate(size, material=m, position=(0, 0, 0.3 * i))
            for i, (size, m) in enumerate(zip(sizes, materials, strict=False))
        ]
        front = [sarcl.rcs(sheet, 0.0, elevation, frequency, polarization=("HH", "VV")) for sheet in sheets]
        scene = plate
        for sheet in sheets:
            scene = scene + sheet
        whole = sarcl.rcs(scene, 0.0, elevation, frequency, polarization=("HH", "VV"))
        return whole, front

    alone = sarcl.rcs(plate, 0.0, elevation, frequency, polarization=("HH", "VV"))
    vacuum, glass = sarcl.Material(1.0, thickness=0.01), sarcl.Material(EPS, thickness=0.01)
    assert seen(vacuum)[0] == pytest.approx(alone, abs=1e-9)
    one, (front,) = seen(glass)
    two, (lower, upper) = seen(glass, glass)
    through = (one - front) / alone  # T^2
    assert (two - upper - through * lower) / alone == pytest.approx(through**2, rel=1e-6)


def test_of_a_plate_partly_behind_a_sheet_just_that_part_is_seen_through():
    frequency, glass = 5e9, sarcl.Material(EPS - 0.3j, thickness=0.004)
    sheet = shapes.plate((1.0, 1.0), position=(0.5, 0, 0.5), material=glass)
    plate, halves = shapes.plate((0.4, 0.4)), [shapes.plate((0.2, 0.4), position=(x, 0, 0)) for x in (-0.1, 0.1)]
    s, front, *parts = (sarcl.rcs(x, 0.0, np.pi / 2, frequency) for x in (plate + sheet, sheet, *halves))
    (_, transmitted), _ = films(0.004, frequency, 0.0, EPS - 0.3j)
    through = (s - front - parts[0]) / parts[1]
    assert decibels(through / transmitted**2) == pytest.approx(0, abs=GATE)


def test_turned_sheets_act_on_their_own_axes():
    """All turned about the line of sight by 30 deg: the scattering matrix turns with them."""
    turn, frequency = np.radians(30.0), 5e9
    glass = sarcl.Material(EPS, thickness=0.01)
    # line of sight along x; sheet inclined by 50 deg about y, plate behind it faces the radar
    tilt = np.array([[np.cos(0.7), 0, np.sin(0.7)], [0, 1, 0], [-np.sin(0.7), 0, np.cos(0.7)]])
    roll = np.array([[1, 0, 0], [0, np.cos(turn), -np.sin(turn)], [0, np.sin(turn), np.cos(turn)]])
    face = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])

    def matrix(rotation):
        scene = shapes.plate((30, 30), material=glass, rotation=rotation @ tilt)
        scene = scene + shapes.plate((0.2, 0.3), rotation=rotation @ face, position=(-20.0, 0, 0))
        return sarcl.rcs(scene, 0.0, 0.0, frequency, polarization="all").reshape(2, 2)

    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, s], [-s, c]])
    straight = matrix(np.eye(3))
    expected = [r @ straight @ r.T for r in (rotation, rotation.T)]
    turned = matrix(roll)
    assert abs(straight[0, 0] - straight[1, 1]) > 0.01 * abs(straight[0, 0])
    assert min(np.abs(turned - e).max() for e in expected) < 1e-6 * np.abs(straight).max()


def test_echoes_of_a_sheet_are_those_of_rcs():
    sheet = shapes.plate((0.5, 0.4), material=sarcl.Material(EPS, 0.01, thickness=0.003))
    azimuth, elevation = np.radians([0.0, 20, 40, 60]), np.radians([60.0, 70, 80, 50])
    u = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1)
    chirp = sarcl.Waveform.chirp(center=5e9, bandwidth=100e6, duration=1e-6)
    raw = sarcl.echo(sheet, chirp, sarcl.Trajectory(None, 1e6 * u), reference=(0, 0, 0), polarization="VV")
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    s = sarcl.rcs(sheet, azimuth, elevation, frequencies, polarization="VV")
    assert np.linalg.norm(raw.samples - s) < 2e-3 * np.linalg.norm(s)
    assert raw.report.plan["sums"] == "in float64"


GLASS = sarcl.Material(6.0, thickness=0.005)
TRACK = sarcl.Trajectory.line(start=(-1e3, -2, 800), velocity=(0, 10, 0), prf=10.0, n_pulses=4)
ASIDE = sarcl.Trajectory.line(start=(-1e3, 90, 800), velocity=(0, 10, 0), prf=10.0, n_pulses=4)
CHIRP = sarcl.Waveform.chirp(center=5e9, bandwidth=100e6, duration=1e-6)
HOUSE = shapes.plate((1, 1), material=GLASS) + shapes.plate((1, 1), position=(0, 0, -1))
BEHIND = shapes.plate((1, 1), material=GLASS) + shapes.plate((1, 1), position=(1.25, 0, -1))
FOUR = sum((shapes.plate((1, 1), position=(0, 0, 0.1 * i), material=GLASS) for i in range(1, 4)), HOUSE)
ROUGH = replace(BEHIND, roughness=np.array([0, 0, 0.01, 0.01]))
BAD = {
    "negative": (lambda: sarcl.Material(3, thickness=-1), "thickness is -1 m; it cannot be negative"),
    "of a conductor": (lambda: sarcl.Material(thickness=0.01), "thickness is 0.01 m of a perfect conductor"),
    "rough": (lambda: sarcl.Material(3, height=1e-3, thickness=0.01), "or a rough surface"),
    "closed body": (lambda: shapes.box((1, 1, 1), material=GLASS), "facet 0 reflects from one side .*two_sided=True"),
    "echo forward": (lambda: sarcl.echo(HOUSE, CHIRP, TRACK, receiver=ASIDE, forward=True), "computed with forward"),
    "echo of edges": (lambda: sarcl.echo(HOUSE, CHIRP, TRACK, edges=True), "not computed with edges=True"),
    "echo of bounces": (lambda: sarcl.echo(HOUSE, CHIRP, TRACK, bounces=2), "give bounces=1"),
    "echo of rough facets": (lambda: sarcl.echo(ROUGH, CHIRP, TRACK), "facet 2 lies behind a thin sheet"),
    "spectral echo": (lambda: sarcl.spectral_echo(HOUSE, CHIRP, TRACK), "for which use echo or rcs"),
    "forward": (lambda: sarcl.rcs(HOUSE, 0, 1, 5e9, receiver=(0.1, 1), forward=True), "not computed with forward=True"),
    "four for two": (lambda: sarcl.rcs(FOUR, 0, 1, 5e9, receiver=(0.1, 1)), "4 thin sheets; .*up to 3 with a receiver"),
    "checked": (lambda: sarcl.rcs(HOUSE, 0, 1, 5e9, check=True), "check=True has no second way"),
    "many": (
        lambda: sarcl.rcs(shapes.box((1, 1, 1), material=GLASS, two_sided=True), 0, 1, 5e9), "6 thin sheets; .*up to 4"
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:too few facets for speckle")
@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_named(name):
    call, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        call()
