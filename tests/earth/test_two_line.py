"""Two-line elements: the verification set of SGP4, the Earth-fixed frame, and damaged lines."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.earth.two_line import TwoLineElements

pytest.importorskip("sgp4", reason="no sgp4: pip install sarcl[orbits]")

# Vanguard 1, the first case of the verification set (Vallado et al., Revisiting Spacetrack Report #3, AIAA 2006-6753)
LINE1 = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753"
LINE2 = "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667"
TOLERANCE = {
    "verification": 2e-5,  # m and m/s: printed to 1e-5 m and 1e-6 m/s
    "years": 2e-4,  # m, of positions 1.8e6 minutes, 3.5 years, from the epoch
}


def checked(line):
    """A line with the check sum that its characters add up to: three of the set were made up without one."""
    return line[:68] + str(sum(int(c) if c.isdigit() else c == "-" for c in line[:68]) % 10)


def test_the_verification_set_is_met(data_folder):
    lines = [x for x in (data_folder / "orbits/SGP4-VER.TLE").read_text().splitlines() if x[:2] in ("1 ", "2 ")]
    elements = {int(a[2:7]): (checked(a), checked(b)) for a, b in zip(lines[::2], lines[1::2], strict=True)}
    wanted: dict[int, list[list[float]]] = {}
    for line in (data_folder / "orbits/tcppver.out").read_text().splitlines():
        words = line.split()
        if len(words) == 2:
            number = int(words[0])
            wanted[number] = []
        elif words:
            wanted[number].append([float(w) for w in words[:7]])
    assert len(wanted) == 32 and set(wanted) == set(elements)
    for number, rows in wanted.items():
        if number == 33334:  # made to fail: its eccentricity leaves its range at once
            with pytest.raises(ValueError, match="perturbed eccentricity is outside the range"):
                TwoLineElements.parsed(*elements[number]).teme(np.zeros(1))
            continue
        minutes, positions, velocities = np.split(np.array(rows), [1, 4], axis=1)
        p, v = TwoLineElements.parsed(*elements[number]).teme(60 * minutes[:, 0])
        tolerance = TOLERANCE["years" if np.abs(minutes).max() > 1e6 else "verification"]
        assert np.abs(p - 1e3 * positions).max() <= tolerance and np.abs(v - 1e3 * velocities).max() <= tolerance


def test_positions_are_those_of_sgp4_turned_by_sidereal_time():
    orbit = sarcl.Orbit.tle(LINE1, LINE2)
    assert str(orbit.epoch) == "2000-06-27T18:50:19.733568000"
    t = np.array([-80000.0, 0.0, 1.2345, 4000.0, 4004.9, 80000.0])
    teme, rough = orbit.path.teme(t)
    days = (orbit.epoch - np.datetime64("2000-01-01T12:00", "ns")) / np.timedelta64(1, "D") + t / 86400
    # in degrees, of days since J2000 in UT1 (Astronomical Almanac, section B): IAU 1982 without its small terms
    angle = np.radians(280.46061837 + 360.98564736629 * days + 0.000387933 * (days / 36525) ** 2)
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = teme.T
    fixed = np.stack([c * x + s * y, c * y - s * x, z], axis=1)
    assert np.abs(orbit.positions(t) - fixed).max() <= 0.05  # m: 1e-8 degrees of the formula above
    slope = (orbit.positions(t[1:5] + 0.01) - orbit.positions(t[1:5] - 0.01)) / 0.02
    assert np.abs(slope - orbit.velocities(t[1:5])).max() <= 1e-6
    # SGP4's own velocities are no derivative: the reason for which they are not used
    spin = np.cross([0, 0, 7.292115e-5], fixed)
    own = np.stack([c * rough[:, 0] + s * rough[:, 1], c * rough[:, 1] - s * rough[:, 0], rough[:, 2]], 1) - spin
    assert 1e-2 < np.abs(own - orbit.velocities(t)).max() < 20


def test_an_orbit_of_two_lines_reaches_a_day_from_its_epoch_and_says_so():
    orbit = sarcl.Orbit.tle(LINE1, LINE2)
    assert orbit.span == (-86400.0, 86400.0) and "SGP4" in orbit.describe()
    with pytest.raises(ValueError, match="outside the orbit"):
        orbit.positions(1e5)
    assert sarcl.Orbit.tle(LINE1, LINE2, span=(0, 1e6)).positions(9e5).shape == (3,)


@pytest.mark.parametrize(
    "line1, line2, wanted",
    [
        (LINE2, LINE1, "line1 is .*wanted the 69 characters of line 1"),
        (LINE1[:-5], LINE2, "69 characters"),
        (None, LINE2, "line1 is None"),
        (LINE1.replace("58002B", "58003B"), LINE2, "line1 has check sum '3', but its characters add up to 4"),
        (LINE1, LINE2.replace("34.2682", "34.2683"), "line2 has check sum"),
        (LINE1, "2 00006" + LINE2[7:68] + "8", "satellite 00005 and line2 of 00006"),
    ],
)
def test_damaged_lines_are_refused(line1, line2, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.Orbit.tle(line1, line2)


def summed(line, columns, text):
    """A line with other text in some columns (from 1, as they are counted), and its check sum."""
    line = line[: columns - 1] + text + line[columns - 1 + len(text) : 68]
    return line + str(sum(int(c) if c.isdigit() else c == "-" for c in line) % 10)


@pytest.mark.parametrize(
    "line1, line2, wanted",
    [
        (summed(LINE1, 21, "000"), LINE2, "line1 has '000.*columns 21 to 32; the day of the epoch is .* from 1 to 367"),
        (summed(LINE1, 21, "-01"), LINE2, "the day of the epoch"),
        (summed(LINE1, 19, "XX"), LINE2, "line1 has 'XX' in columns 19 to 20"),
        (LINE1, summed(LINE2, 9, "200.0000"), "inclination, degrees, is a number from 0 to 180"),
        (LINE1, summed(LINE2, 27, "       "), "line2 has '       ' in columns 27 to 33; the eccentricity"),
        (LINE1, summed(LINE2, 53, "-5.72125391"), "mean motion"),  # SGP4 gives NaN for it, and no error
    ],
)
def test_numbers_that_no_orbit_has_are_refused_in_spite_of_a_right_check_sum(line1, line2, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.Orbit.tle(line1, line2)


def test_a_decayed_satellite_has_no_position():
    # case 28872 of the verification set decays within an hour
    line1 = "1 28872U 05037B   05333.02012661  .25992681  00000-0  24476-3 0  1534"
    line2 = "2 28872  96.4736 157.9986 0303955 244.0492 110.6523 16.46015938 10708"
    with pytest.raises(ValueError, match=r"no position at .* s from their epoch.*decayed.*a date that is closer"):
        sarcl.Orbit.tle(line1, line2).positions(4000.0)
