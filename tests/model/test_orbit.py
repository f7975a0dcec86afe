"""Orbits: laws of Kepler and of the rotating Earth, interpolation of states, files, and what is refused."""

from __future__ import annotations

import datetime
from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.earth import rotation
from sarcl.earth.kepler import KeplerElements, eccentric_anomaly

TOLERANCE = {
    "interpolation": 1e-8,  # m: the rounding of positions of 7e6 m, some times over
    "energy": 1e-14,  # relative: float64, some operations
    "derivative": 2e-7,  # m/s: central differences over 0.02 s of positions that are rounded to 1e-9 m
}
PERIOD = 2 * np.pi * np.sqrt(7.07e6**3 / rotation.GM)
SENTINEL = "orbits/s1b-iw-grd-vv-20211223t051122-20211223t051147-030148-039993-001.xml"


def kepler(**changed):
    given = {
        "semi_major_axis": 7.07e6, "eccentricity": 0.01, "inclination": 1.7, "node": 0.3, "argument_of_perigee": 1.0,
        "mean_anomaly": 0.2,
    }  # fmt: skip
    return sarcl.Orbit.kepler(**{**given, **changed})


def states(step=10.0, n=61, orbit=None):
    t = (np.arange(n) - n // 2) * step
    orbit = orbit or kepler()
    return t, orbit.positions(t).copy(), orbit.velocities(t).copy()


# Kepler


@pytest.mark.parametrize("eccentricity", [0.0, 0.01, 0.7, 0.98])
def test_energy_momentum_and_period_are_those_of_kepler(eccentricity):
    a = 7e6 / (1 - eccentricity)
    path = KeplerElements(a, eccentricity, 1.1, 0.3, 1.0, 0.2, 0.0, False)
    period = 2 * np.pi * np.sqrt(a**3 / rotation.GM)
    p, v = path.inertial(np.linspace(0, period, 1001))
    radius = np.linalg.norm(p, axis=1)
    energy = (v**2).sum(axis=1) / 2 - rotation.GM / radius
    assert np.abs(energy / (-rotation.GM / (2 * a)) - 1).max() <= TOLERANCE["energy"] * 40 / (1 - eccentricity)
    momentum = np.cross(p, v)
    wanted = np.sqrt(rotation.GM * a * (1 - eccentricity**2))
    pole = np.array([np.sin(1.1) * np.sin(0.3), -np.sin(1.1) * np.cos(0.3), np.cos(1.1)])
    assert np.abs(momentum / wanted - pole).max() <= 1e-12 / (1 - eccentricity)
    assert np.abs(p[-1] - p[0]).max() <= 1e-6
    assert radius.min() >= a * (1 - eccentricity) * (1 - 1e-14)
    perigee, _ = path.inertial(np.array([-0.2 / path.mean_motion]))  # where the mean anomaly is 0
    assert np.linalg.norm(perigee) == pytest.approx(a * (1 - eccentricity), rel=1e-12)


def test_kepler_s_equation_is_solved_to_rounding():
    mean = np.concatenate([np.linspace(-20, 20, 4001), [0.0, np.pi, 1e-9, 1e5]])
    for e in (0.0, 0.1, 0.5, 0.9, 0.9999):
        found = eccentric_anomaly(mean, e)
        assert (np.abs(found - e * np.sin(found) - mean) <= 1e-15 * np.maximum(5, np.abs(mean))).all()


@pytest.mark.parametrize("j2", [False, True])
def test_velocities_are_the_derivative_of_positions_over_the_rotating_earth(j2):
    orbit = kepler(j2=j2)
    t = np.linspace(-2000, 2000, 41)
    slope = (orbit.positions(t + 0.01) - orbit.positions(t - 0.01)) / 0.02
    assert np.abs(slope - orbit.velocities(t)).max() <= TOLERANCE["derivative"] * 3
    change = (orbit.velocities(t + 0.5) - orbit.velocities(t - 0.5)) / 1.0
    assert np.abs(change - orbit.accelerations(t)).max() <= 1e-12


def test_an_earth_fixed_orbit_is_the_inertial_one_turned_back_by_the_earth():
    orbit = kepler()
    t = np.linspace(-2000, 2000, 11)
    p, v = orbit.path.inertial(t)
    angle = 7.292115e-5 * t
    back = np.stack(
        [np.cos(angle) * p[:, 0] + np.sin(angle) * p[:, 1], np.cos(angle) * p[:, 1] - np.sin(angle) * p[:, 0], p[:, 2]],
        1,
    )
    assert np.abs(orbit.positions(t) - back).max() <= 1e-8
    # over the ground a satellite moves as in space, less what the Earth moves
    fixed = orbit.velocities(t) + np.cross([0, 0, 7.292115e-5], orbit.positions(t))
    assert np.linalg.norm(fixed, axis=1) == pytest.approx(np.linalg.norm(v, axis=1), rel=1e-14)


def test_the_node_is_a_longitude_without_an_epoch_and_a_right_ascension_with_one():
    east = kepler(eccentricity=0.0, argument_of_perigee=0.0, mean_anomaly=0.0, node=0.4).positions(0.0)
    assert np.arctan2(east[1], east[0]) == pytest.approx(0.4, abs=1e-14)
    epoch = "1992-08-20T12:14:00"  # Vallado, Fundamentals of Astrodynamics, example 3-5: 152.578787810 degrees
    dated = kepler(eccentricity=0.0, argument_of_perigee=0.0, mean_anomaly=0.0, node=0.4, epoch=epoch).positions(0.0)
    turned = np.degrees(0.4 - np.arctan2(dated[1], dated[0])) % 360
    assert turned == pytest.approx(152.578787810, abs=1e-7)  # printed from a Julian date of 1e-9 days


def test_a_sun_synchronous_orbit_turns_once_a_year_by_j2():
    # 98.6 degrees at 786 km: the node follows the mean sun, 360 degrees in 365.2422 days
    path = KeplerElements(7.1643e6, 0.001, np.radians(98.55), 0.0, 0.0, 0.0, 0.0, True)
    assert np.degrees(path.rates[0]) * 86400 == pytest.approx(360 / 365.2422, rel=5e-3)
    # perigee rests at the critical inclination, sin^2 i = 4/5
    still = KeplerElements(2.66e7, 0.7, np.arcsin(np.sqrt(0.8)), 0.0, 0.0, 0.0, 0.0, True)
    assert abs(still.rates[1]) < 1e-16 * still.mean_motion


# state vectors


@pytest.mark.parametrize("step, n, tolerance", [(10.0, 61, 1.0), (10.0, 5, 10), (60.0, 31, 1.0), (300.0, 15, 1000)])
def test_states_are_interpolated_to_rounding_and_the_order_follows_the_spacing(step, n, tolerance):
    t, p, v = states(step, n)
    orbit = sarcl.Orbit.states(t, p, v)
    fine = np.linspace(t[0], t[-1], 1501)
    assert np.abs(orbit.positions(fine) - kepler().positions(fine)).max() <= tolerance * TOLERANCE["interpolation"]
    assert np.abs(orbit.velocities(fine) - kepler().velocities(fine)).max() <= tolerance * TOLERANCE["interpolation"]
    assert np.abs(orbit.positions(t) - p).max() <= TOLERANCE["interpolation"]
    assert "degree" in orbit.describe() and f"{step:g} s" in orbit.describe()


def test_wider_spacing_takes_a_higher_order():
    orders = [sarcl.Orbit.states(*states(step, 31)).path.n_nodes for step in (5.0, 10.0, 60.0, 150.0)]
    assert orders == sorted(orders) and orders[0] < orders[-1]


def test_the_error_of_states_left_out_bounds_the_error_between_states():
    for step in (60.0, 100.0, 150.0, 200.0):
        t, p, v = states(step, 13)
        orbit = sarcl.Orbit.states(t, p, v)
        fine = np.linspace(t[0], t[-1], 3001)
        error = np.linalg.norm(orbit.positions(fine) - kepler().positions(fine), axis=1).max()
        assert error <= orbit.path.left_out + TOLERANCE["interpolation"]


def test_inexact_velocities_are_not_used():
    t, p, v = states()
    rough = v + np.random.default_rng(0).normal(size=v.shape) * 1e-2
    orbit = sarcl.Orbit.states(t, p, rough)
    assert not orbit.path.hermite and "Lagrange" in orbit.describe()
    fine = np.linspace(-200, 200, 999)
    assert np.abs(orbit.positions(fine) - kepler().positions(fine)).max() <= 1e-5
    assert np.abs(orbit.velocities(fine) - kepler().velocities(fine)).max() <= 1e-5


@pytest.mark.parametrize("n", [4, 7, 61])
def test_velocities_are_derived_where_none_are_given(n):
    t, p, _ = states(10.0, n)
    made = sarcl.Orbit.states(t, p)
    between = np.linspace(t[0], t[-1], 501)
    error = np.linalg.norm(made.positions(between) - kepler().positions(between), axis=1)
    assert error.max() < (0.01 if n == 4 else 1e-4 if n == 7 else 1e-7)


def test_velocities_that_differ_at_the_ends_are_named_and_the_orbit_is_good_without_them():
    """As published orbits are whose velocities come from a filter that runs in and out."""
    t, p, v = states(10.0, 61)
    v[:3] += (1.2, 0, 0)
    v[-4:] += (0, -1.2, 0)
    with pytest.raises(ValueError, match=r"velocities\[0:3, 57:61\] of 61 differ by up to 1\.2 m/s .* trim .* derive"):
        sarcl.Orbit.states(t, p, v)
    inner = slice(3, -4)
    for orbit in (sarcl.Orbit.states(t, p), sarcl.Orbit.states(t[inner], p[inner], v[inner])):
        at = np.linspace(-200, 200, 77)
        assert np.abs(orbit.positions(at) - kepler().positions(at)).max() < 1e-7


def test_times_may_have_any_shape_and_reach_to_both_ends():
    orbit = sarcl.Orbit.states(*states())
    assert orbit.positions(0.0).shape == (3,) and orbit.velocities(np.zeros((2, 4))).shape == (2, 4, 3)
    assert orbit.positions([-300.0, 300.0]).shape == (2, 3) and orbit.positions(np.zeros((0,))).shape == (0, 3)


def bad_states():
    t, p, v = states()
    late, twice, nan, wild = t.copy(), t.copy(), p.copy(), p.copy()
    late[5], twice[5] = t[4] - 1, t[4]
    nan[7, 1] = np.nan
    wild[9] += 100
    gap = np.delete(np.arange(61), [20, 21])
    inertial = v + np.cross([0, 0, 7.292115e-5], p)
    space = kepler().path.inertial(t)
    return [
        (
            (t, *space),
            "the states accelerate by .* m/s.2, where .* in an inertial frame: turn both by the sidereal time",
        ),
        ((t, p / 1e3, v / 1e3), r"positions\[\d+\] is .* m from the Earth's centre, inside the Earth.*in km"),
        ((t * 1e3, p, v / 1e3), "the states accelerate by .*check units"),
        ((t, p / 0.3048, v / 0.3048), "the states accelerate by .*check units"),
        ((late, p, v), r"times\[5\] = -261 s is before times\[4\] = -260 s.*sort"),
        ((twice, p, v), r"times\[5\] = -260 s repeats times\[4\].*keep one"),
        ((t[gap], p[gap], v[gap]), r"gap of 30 s from times\[19\] = -110 s on, where they are usually 10 s"),
        ((t[:3], p[:3], v[:3]), "has 3 states; an orbit needs at least 4"),
        ((t, nan, v), r"positions\[7, 1\] is nan"),
        ((t, p, v[:-1]), r"velocities has shape \(60, 3\), wanted \(61, 3\)"),
        ((t, wild, v), r"positions\[9\] \(at -210 s\) is .* m away|velocities\[.*\] of 61 differ"),
        ((t, p, inertial), "inertial frame: subtract"),
        ((t, p, v / 1e3), r"velocities\[0:61\] of 61 differ by .* check units"),
        ((t, p[::-1], v), r"velocities\[0:61\] of 61 differ"),
    ]


@pytest.mark.parametrize("given, wanted", bad_states(), ids=range(14))
def test_bad_states_are_refused(given, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.Orbit.states(*given)


@pytest.mark.parametrize(
    "changed",
    [
        {"inclination": np.pi / 2, "eccentricity": 0.0, "argument_of_perigee": 0.0, "mean_anomaly": 0.0},
        {"inclination": 3.0},
        {"semi_major_axis": 4.2164e7, "eccentricity": 0.0, "inclination": 0.0},
        {"semi_major_axis": 6.6e6, "eccentricity": 0.005},
        {"semi_major_axis": 2.66e7, "eccentricity": 0.7},
        {"j2": True},
    ],
)
def test_states_of_all_kinds_of_orbits_are_taken_and_inertial_ones_are_not(changed):
    t = np.arange(0.0, 200.0, 10.0)
    orbit = kepler(**changed, span=(0, 1000))
    rough = np.random.default_rng(1).normal(size=(20, 3)) * 1e-3
    sarcl.Orbit.states(t, orbit.positions(t) + rough, orbit.velocities(t) + rough)
    with pytest.raises(ValueError, match="inertial frame"):
        sarcl.Orbit.states(t, *orbit.path.inertial(t))


def test_one_missing_state_is_no_gap():
    kept = np.delete(np.arange(61), 30)
    t, p, v = (a[kept] for a in states())
    orbit = sarcl.Orbit.states(t, p, v)
    assert np.abs(orbit.positions(0.0) - kepler().positions(0.0)).max() <= orbit.path.left_out + 1e-8


def test_times_outside_the_orbit_name_it():
    orbit = sarcl.Orbit.states(*states(), epoch="2021-12-23")
    with pytest.raises(
        ValueError, match=r"t\[1\] = 301 s is outside the orbit, which reaches from -300 to 300 s.*2021"
    ):
        orbit.positions([0.0, 301.0])
    with pytest.raises(ValueError, match=r"t = -301 s"):
        orbit.velocities(-301.0)
    with pytest.raises(ValueError, match=r"t\[0\] is nan"):
        orbit.positions([np.nan])
    with pytest.raises(ValueError, match="outside the orbit"):
        orbit.trajectory(start=299.0, prf=10.0, n_pulses=100)


@pytest.mark.parametrize(
    "changed, wanted",
    [
        ({"semi_major_axis": 7070.0}, "perigee is .* below its surface.*m, from the centre"),
        ({"eccentricity": 1.0}, "an ellipse has less than 1"),
        ({"eccentricity": -0.1}, "at least 0"),
        ({"inclination": 98.0}, "was it in degrees"),
        ({"node": np.nan}, "node is nan"),
        ({"span": (1, 0)}, "first time must be before"),
        ({"epoch": "23.12.2021"}, "is not in UTC as wanted"),
    ],
)
def test_bad_elements_are_refused(changed, wanted):
    with pytest.raises(ValueError, match=wanted):
        kepler(**changed)


# dates


def test_dates_become_seconds_since_the_epoch():
    orbit = sarcl.Orbit.states(*states(), epoch="2021-12-23T05:10:21.0293")
    assert orbit.seconds("2021-12-23T05:10:22.0293") == 1.0
    late = datetime.datetime(2021, 12, 23, 6, 10, 21, tzinfo=datetime.timezone(datetime.timedelta(hours=1)))
    assert orbit.seconds(late) == pytest.approx(-0.0293, abs=1e-12)
    assert orbit.seconds(["2021-12-23T05:10:21.0293Z", "2021-12-24T05:10:21.0293"]).tolist() == [0.0, 86400.0]
    with pytest.raises(ValueError, match="no epoch"):
        sarcl.Orbit.states(*states()).seconds("2021-12-23")
    assert orbit.seconds(np.array(["2021-12-23T05:10:22.0293"])).tolist() == [1.0]


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        ("2016-12-31T23:59:60", "within a leap second"),
        ("2021-13-45", "does not exist"),
        ("1500-01-01", "years from 1678 to 2261"),
        (np.datetime64("3000-01-01"), "years from 1678 to 2261"),  # nanoseconds would wrap around in silence
        (np.datetime64("NaT"), "NaT"),
        (20211223, "is a int; wanted UTC"),
    ],
)
def test_dates_that_do_not_exist_are_refused(value, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.Orbit.states(*states(), epoch=value)
    with pytest.raises(ValueError, match=wanted):
        sarcl.Orbit.states(*states(), epoch="2021-12-23").seconds(np.array([value]))


# files

OSV = """<OSV><TAI>TAI={tai}</TAI><UTC>UTC={utc}</UTC><UT1>UT1={utc}</UT1><Absolute_Orbit>+30144</Absolute_Orbit>
<X unit="m">{x:.6f}</X><Y unit="m">{y:.6f}</Y><Z unit="m">{z:.6f}</Z>
<VX unit="m/s">{vx:.6f}</VX><VY unit="m/s">{vy:.6f}</VY><VZ unit="m/s">{vz:.6f}</VZ><Quality>NOMINAL</Quality></OSV>"""
EOF = """<?xml version="1.0"?><Earth_Explorer_File xmlns="http://eop-cfi.esa.int/CFI"><Earth_Explorer_Header>
<Variable_Header><Ref_Frame>{frame}</Ref_Frame></Variable_Header></Earth_Explorer_Header>
<Data_Block type="xml"><List_of_OSVs>{states}</List_of_OSVs></Data_Block></Earth_Explorer_File>"""


def written(path, frame="EARTH_FIXED", **changed):
    """A file as those of Sentinel-1's precise orbits are, with states of the Kepler orbit."""
    lines = []
    for t, p, v in zip(*states(n=21), strict=True):
        utc = (np.datetime64("2021-12-23T00:00:00") + np.timedelta64(int(t), "s")).astype(str)
        fields = dict(zip(("x", "y", "z", "vx", "vy", "vz"), (*p, *v), strict=True))
        lines.append(OSV.format(tai=utc, utc=utc + ".000000", **fields))
    text = EOF.format(frame=frame, states="".join(lines))
    for old, new in changed.items():
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


def test_an_orbit_file_of_sentinel_1_gives_its_states(tmp_path):
    orbit = sarcl.Orbit.read(written(tmp_path / "s1.EOF"))
    assert orbit.epoch == np.datetime64("2021-12-22T23:58:20") and orbit.span == (0.0, 200.0)
    t = np.linspace(0, 200, 333)
    assert np.abs(orbit.positions(t) - kepler().positions(t - 100)).max() <= 3e-6  # the file is rounded to 1e-6 m


@pytest.mark.parametrize(
    "changed, wanted",
    [
        ({"frame": "GEO_TRUE"}, "states in the frame 'GEO_TRUE'; give Earth-fixed ones"),
        ({"Earth_Explorer_File>": "Earth>"}, "cannot be read as XML"),
        ({"UTC=2021-12-23T00:00:00.000000": "UTC=noon"}, "has the time 'noon'; wanted UTC such as"),
        (
            {"UTC=2021-12-23T00:00:00.000000": "UTC=2021-12-22T23:59:50.000000"},
            r"times\[10\] = 90 s repeats times\[9\]",
        ),
        ({'<X unit="m">': '<X unit="m">n'}, "has <X> 'n.*wanted a number"),
        ({"<VY": "<WY"}, "XML|without <VY>"),
        ({"<List_of_OSVs>": '<List_of_OSVs count="42">'}, "announces 42 state vectors and has 21: it was cut off"),
        ({'<X unit="m">': '<X unit="km">'}, "<X> in 'km'; wanted m"),
        ({"UTC=2021-12-23T00:00:00.": "UTC=2021-12-23T23:59:60."}, "leap second"),
        ({"UTC=2021-12-23T00:00:00.": "UTC=2021-02-30T00:00:00."}, "does not exist"),
    ],
)
def test_damaged_orbit_files_are_refused(tmp_path, changed, wanted):
    with pytest.raises(ValueError, match=wanted):
        sarcl.Orbit.read(written(tmp_path / "s1.EOF", **changed))


def test_files_that_are_no_orbits_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.EOF.*check the name"):
        sarcl.Orbit.read(tmp_path / "none.EOF")
    with pytest.raises(IsADirectoryError, match="is a folder"):
        sarcl.Orbit.read(tmp_path)
    (tmp_path / "a.xml").write_text("<kml></kml>")
    with pytest.raises(ValueError, match=r"begins with <kml>; orbits are read from .*EOF.*annotation.*ISCE3"):
        sarcl.Orbit.read(tmp_path / "a.xml")
    (tmp_path / "b.xml").write_text("<product></product>")
    with pytest.raises(ValueError, match="without state vectors"):
        sarcl.Orbit.read(tmp_path / "b.xml")


@pytest.mark.parametrize("name, n", [(SENTINEL, 16), ("orbits/isce3_orbit_jason2.xml", 10)])
def test_measured_states_left_out_are_met_to_30_micrometres(data_folder, name, n):
    orbit = sarcl.Orbit.read(data_folder / name)
    assert len(orbit.path.times) == n and orbit.path.left_out <= 3e-5
    again = sarcl.Orbit.states(orbit.path.times, orbit.path.positions, orbit.path.velocities)
    t = np.linspace(*orbit.span, 77)
    assert np.array_equal(again.positions(t), orbit.positions(t))
    # another order, chosen by nobody: the interpolation error between the states
    other = replace(orbit.path, n_nodes=8, hermite=False)
    inside = np.linspace(orbit.span[0] + 30, orbit.span[1] - 30, 200)
    assert np.abs(other.at(inside)[0] - orbit.positions(inside)).max() <= 1e-5


# tracks


def test_a_track_has_the_orbit_s_states_at_its_pulses():
    track = kepler().trajectory(start=-1.0, prf=1700.0, n_pulses=64)
    assert np.array_equal(track.times, -1 + np.arange(64) / 1700.0)
    assert np.array_equal(track.positions, kepler().positions(track.times))
    assert np.array_equal(track.velocities, kepler().velocities(track.times))
    assert track.attitude is None and not track.stop_and_go
    assert not track.picked(slice(3, 9)).stop_and_go and len(track.picked(slice(3, 9)).accelerations) == 6
    with pytest.raises(ValueError, match="no velocities or no accelerations"):
        replace(track, accelerations=None)


@pytest.mark.parametrize("side", ["right", "left"])
def test_attitudes_point_the_boresight_where_their_names_say(side):
    orbit, aimed = kepler(), {}
    for attitude in ("zero-doppler", "yaw", "orbital"):
        track = orbit.trajectory(start=500.0, prf=10.0, n_pulses=5, attitude=attitude, look=0.5, side=side)
        aimed[attitude] = track.attitude[:, :, 0]
        axes = track.attitude
        assert np.allclose(np.swapaxes(axes, 1, 2) @ axes, np.eye(3), atol=1e-14)
    v, p = track.velocities, track.positions
    lon, lat, _ = sarcl.wgs84.geodetic(p)
    up = sarcl.wgs84.up(lon, lat)
    right = np.cross(v, up)
    for boresight in aimed.values():
        assert (np.sign((boresight * right).sum(axis=1)) == (1 if side == "right" else -1)).all()
    speed = np.linalg.norm(v, axis=1)
    assert np.abs((aimed["zero-doppler"] * v).sum(axis=1) / speed).max() < 1e-15
    climb = (v * up).sum(axis=1)
    assert (aimed["yaw"] * v).sum(axis=1) == pytest.approx(-climb * np.cos(0.5), rel=1e-9)
    space = v + np.cross([0, 0, 7.292115e-5], p)
    assert np.abs((aimed["orbital"] * space).sum(axis=1)).max() < 1e-11
    # without steering the Earth's rotation shifts the Doppler frequency: by kilohertz at C band
    assert np.abs(2 * 5.4e9 / 299792458 * (aimed["orbital"] * v).sum(axis=1)).min() > 500


def test_an_attitude_needs_a_look_angle_and_a_known_name():
    with pytest.raises(ValueError, match="needs look="):
        kepler().trajectory(start=0.0, prf=1.0, n_pulses=1, attitude="yaw")
    with pytest.raises(ValueError, match="which needs attitude="):
        kepler().trajectory(start=0.0, prf=1.0, n_pulses=1, look=0.5)
    with pytest.raises(ValueError, match="choose one of 'zero-doppler', 'yaw', 'orbital'"):
        kepler().trajectory(start=0.0, prf=1.0, n_pulses=1, attitude="roll", look=0.5)


def test_a_track_may_be_named_by_its_middle_its_duration_and_dates():
    orbit = sarcl.Orbit.kepler(7.17e6, 0.001, 1.72, epoch="2024-03-01T05:00:00")
    wanted = orbit.trajectory(start=99.9, prf=1000.0, n_pulses=201)
    for track in (
        orbit.trajectory(center=100.0, prf=1000.0, n_pulses=201),
        orbit.trajectory(center="2024-03-01T05:01:40", prf=1000.0, duration=0.201),
        orbit.trajectory(start=datetime.datetime(2024, 3, 1, 5, 1, 39, 900_000), prf=1000.0, duration=0.2014),
        orbit.trajectory(start=np.datetime64("2024-03-01T05:01:39.9"), prf=1000.0, n_pulses=201),
    ):
        assert np.abs(track.times - wanted.times).max() < 1e-9
        assert np.abs(track.positions - wanted.positions).max() < 1e-5
    for given, said in (
        ({"start": 1, "center": 2, "n_pulses": 3}, "start or center"),
        ({"n_pulses": 3}, "start or center"),
        ({"start": 1}, "n_pulses or duration"),
        ({"start": 1, "n_pulses": 3, "duration": 1}, "n_pulses or duration"),
        ({"start": 1, "duration": -1}, "duration is -1"),
        ({"start": "noon", "n_pulses": 1}, "date 'noon' is not in UTC"),
    ):
        with pytest.raises(ValueError, match=said):
            orbit.trajectory(prf=10.0, **given)
