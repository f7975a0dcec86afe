"""A pass of a satellite from raw data to images: range-Doppler and backprojection beside theory.

    python bench/spaceborne.py [--quick] [--json FILE] [--pictures FOLDER] [--device ...]

C band, 800 km, 5 km x 1.5 km of ground on an elevation model with two hills, Gaussian heights of the facets' corners,
frustum, cuboid and cylinder, corner reflectors, one of them on a mast. `sarcl.echo` computes the raw data through
an antenna with yaw steering; the beam limits the azimuth. `sarcl.range_doppler` and `sarcl.backproject` focus the same
echoes on the elevation model (without solids). Every line of the table has what theory says and what both images show.
CPU seconds are those of the process, user and system. Quick: 1.4 km x 0.6 km, coarser facets, shorter aperture.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import spaceborne_page
import spaceborne_scene as scene
from spaceborne_scene import BANDWIDTH, CENTER, PRF, RCS, WAVE, Pass

import sarcl

FULL = Pass(swath=(5000.0, 1500.0), cell=2.5, n_pulses=1500, post=20.0, pixel=2.5)
QUICK = Pass(swath=(1400.0, 600.0), cell=4.0, n_pulses=1000, post=20.0, pixel=2.5)
TOLERANCE = 1e-2
RANGE_DOPPLER = 2e-2  # the effective velocity changes over the scene, and with the terrain's height
FINE = 1e-3  # for reflectors
FROM_DATA = "range-Doppler, centroid and rate from the data, and the check of the error"
SLANT_CELL = 299_792_458.0 / (2 * BANDWIDTH)  # m
Row = dict[str, Any]


def main() -> None:
    """Measure, print the table, and write the JSON file and the pictures."""
    from sarcl.bench import documents
    from sarcl.opencl.choose_device import open_device

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--device")
    asked = parser.parse_args()
    document = documents.header([open_device(asked.device)])
    made = Run(QUICK if asked.quick else FULL, asked.device)
    document |= made.document()
    document["machine"]["load"] += documents.load()
    print(spaceborne_page.section("spaceborne", document))
    if asked.pictures:
        made.draw(asked.pictures)
    if asked.json:
        documents.write(document, asked.json)


class Run:
    """Echoes and both images of a pass, and the rows of the table."""

    def __init__(self, made: Pass, device: Any) -> None:
        self.what, self.device = made, device
        self.cpu: dict[str, float] = {}
        self.middle = float(made.track.times[made.n_pulses // 2])
        self.view = made.orbit.view(self.middle, made.origin)
        self.incidence = float(self.view.incidence)
        self.facets = 0
        self.signal, points = self._timed("raw data", self._echo)
        self.raw = self._timed("range compression", lambda: sarcl.compress(self.signal))
        self.alone = sarcl.compress(points)
        self.fast = self._timed("range-Doppler", lambda: self._range_doppler(self.raw))
        self.fast_alone = self._range_doppler(self.alone)
        estimated = self._timed(FROM_DATA, lambda: self._range_doppler(self.raw, "data", check=True))
        self.estimated = estimated.report
        self.grid = sarcl.ImageGrid.on_terrain(made.model, made.pixel, frame="ecef")
        self.slow = self._timed("backprojection", lambda: self._backproject(self.raw, self.grid))

    def _timed(self, name: str, work: Callable[[], Any]) -> Any:
        start = time.process_time()
        out = work()
        self.cpu[name] = time.process_time() - start
        return out

    def _echo(self) -> tuple[Any, Any]:
        """Raw data of everything (ground and solids with shadows, reflectors without), and of the reflectors alone."""
        made = self.what
        window = made.swath[0] / 2 * np.sin(self.incidence) + 150
        options: dict[str, Any] = {
            "antenna": made.antenna, "reference": made.origin, "range_window": (-window, window), "compressed": False,
            "tolerance": TOLERANCE, "device": self.device,
        }  # fmt: skip
        chirp = sarcl.Waveform.chirp(center=CENTER, bandwidth=BANDWIDTH, duration=10e-6)
        everything = made.ground() + made.solids()
        self.facets = len(everything.triangles)
        echoes = sarcl.echo(everything, chirp, made.track, max_edge=1.6 * made.cell, check=True, **options)
        points = sarcl.Scene.points(made.reflectors, np.full(len(made.reflectors), np.sqrt(RCS)))
        bright = sarcl.echo(points, chirp, made.track, **(options | {"tolerance": FINE}))
        return dataclasses.replace(echoes, samples=np.asarray(echoes.samples) + np.asarray(bright.samples)), bright

    def _range_doppler(self, raw: Any, doppler: str = "geometry", check: bool = False) -> Any:
        half = np.array(self.what.swath) / 2
        x, y = (np.array([-1, -1, 1, 1]) * half[0], np.array([-1, 1, -1, 1]) * half[1])
        times, ranges = self.what.orbit.locate(self.what.places(x, y, np.full(4, scene.LEVEL)))
        times = times - ranges.mean() / 299_792_458.0  # of the middle of both paths
        options: dict[str, Any] = {"doppler": doppler, "doppler_rate": doppler, "tolerance": RANGE_DOPPLER}
        return sarcl.range_doppler(
            raw, heights=self.what.model, side="right", times=(times.min(), times.max()),
            ranges=(ranges.min(), ranges.max()), check=check, device=self.device, **options,
        )  # fmt: skip

    def _backproject(self, raw: Any, grid: Any, tolerance: float = TOLERANCE) -> Any:
        return sarcl.backproject(raw, grid, tolerance=tolerance, device=self.device)

    def document(self) -> Row:
        """Everything measured."""
        made, raw = self.what, self.raw
        rows = [*self._doppler(), *self._reflectors(), *self._clutter(), *self._solids()]
        report = self.signal.report
        return {
            "kind": "spaceborne", "swath": made.swath, "pulses": raw.n_rows, "samples": raw.n_samples,
            "facets": self.facets, "incidence_deg": float(np.degrees(self.incidence)), "slant_km": scene.SLANT / 1e3,
            "pixels": {"range-Doppler": self.fast.data.shape, "backprojection": self.grid.shape},
            "cpu": self.cpu, "rows": rows, "plan": dict(report.plan),
            "errors": {
                "raw data": report.measured_error, FROM_DATA: self.estimated.measured_error,
                "backprojection": self.slow.report.measured_error,
            },
        }  # fmt: skip

    def _doppler(self) -> list[Row]:
        """Doppler centroid and rate at the beam's centre: of the geometry, of the track, and of the data."""
        made = self.what
        aim = made.orbit.boresight(self.middle, look=made.look, attitude="yaw")
        seen = made.orbit.view(self.middle + scene.SLANT / 299_792_458.0, aim)  # half way between pulse and echo
        rows = []
        theories = ("Doppler centroid", "Hz", seen.doppler(CENTER)), ("Doppler rate", "Hz/s", seen.doppler_rate(CENTER))
        for name, unit, theory in theories:
            rows.append(
                _row(f"{name}, from the track", unit, theory, _number(self.fast.report.plan[name]), None, ".1f")
            )
            rows.append(_row(f"{name}, from the data", unit, theory, _number(self.estimated.plan[name]), None, ".1f"))
        return rows

    def _reflectors(self) -> list[Row]:
        """Reflectors alone and in the scene, on the ground; and the place of the one on the mast."""
        made, rows = self.what, []
        theory = {"slant range": (0.8859 * SLANT_CELL, -13.26), "azimuth": self._azimuth_response(made.reflectors[2])}
        for words, raw, fast in (
            ("reflectors alone", self.alone, self.fast_alone), ("reflectors in the scene", self.raw, self.fast),
        ):  # fmt: skip
            found = [[self._measured(image, point) for image in self._near(raw, fast, point)]
                     for point in made.reflectors[:-1]]  # fmt: skip
            values = {key: np.array([[m[key] for m in pair] for pair in found]) for key in found[0][0]}
            for axis, (width, lobe) in theory.items():
                rows.append(
                    _row(f"{words}: IRW in {axis}, mean", "m", width, *values[f"irw {axis}"].mean(axis=0), ".3f")
                )
                rows.append(
                    _row(f"{words}: PSLR in {axis}, mean", "dB", lobe, *values[f"pslr {axis}"].mean(axis=0), ".2f")
                )
            for key, unit in (("position", "m"), ("phase", "rad")):
                worst = np.abs(values[key]).max(axis=0)
                rows.append(_row(f"{words}: largest error of {key}", unit, 0.0, *worst, ".4f"))
            level = values["cross section"].mean(axis=0)
            rows.append(_row(f"{words}: cross section, mean", "dBsm", 10 * np.log10(RCS), *level, ".2f"))
        top = made.reflectors[-1]
        when, distance = made.orbit.locate(top)
        apparent = made.orbit.geolocate(float(when), float(distance), made.model, side="right")
        shift, seen = made.local(apparent) - made.local(top), []
        for image in self._near(self.raw, self.fast, apparent):
            seen.append(float(made.local(sarcl.measure(image, near=apparent).position - top + made.origin)[0]))
        rows.append(
            _row(f"layover of the reflector on a mast of {scene.MAST[1]:g} m", "m", float(shift[0]), *seen, ".2f")
        )
        return rows

    def _near(self, raw: Any, fast: Any, point: np.ndarray) -> tuple[Any, Any]:
        """The range-Doppler image, and a backprojected one of the surroundings on the same tangent plane."""
        away = np.linalg.norm(fast.grid.positions - point, axis=-1)
        row, column = np.unravel_index(int(np.argmin(away)), away.shape)
        grid = sarcl.ImageGrid.plane(
            center=point, shape=(192, 192), spacing=1.0, normal=fast.grid.normal_at(int(row), int(column)),
            x_axis=self.what.axes[0],
        )  # fmt: skip
        return fast, self._backproject(raw, grid, FINE)

    def _measured(self, image: Any, point: np.ndarray) -> Row:
        """Response of a reflector: widths in slant range and azimuth, and errors of position, phase and level."""
        seen = sarcl.measure(image, near=point)
        normal = image.grid.normal_at(*(int(i) for i in np.round(image.grid.index(seen.position))))
        middle = self.raw.n_rows // 2
        ends = self.raw.tx[middle], self.raw.rx[middle]
        look = point - ends[0]
        look /= np.linalg.norm(look)
        path = sum(np.linalg.norm(seen.position - end) - np.linalg.norm(point - end) for end in ends)
        weights = self.what.weights(self.raw, point)
        return {
            "irw slant range": seen.irw[0] * float(np.linalg.norm(look - (look @ normal) * normal)),
            "irw azimuth": seen.irw[1], "pslr slant range": seen.pslr[0], "pslr azimuth": seen.pslr[1],
            "position": float(np.linalg.norm(seen.position - point)),
            "phase": float(np.angle(seen.peak * np.exp(-2j * np.pi * path / WAVE))),  # at the true position
            "cross section": 20 * np.log10(np.abs(seen.peak / image.gain) / weights.mean()),
        }  # fmt: skip

    def _azimuth_response(self, point: np.ndarray) -> tuple[float, float]:
        """Width at half power, m, and highest side lobe, dB, of the sum over the pulses with the antenna's weights."""
        weights = self.what.weights(self.raw, point)
        looks = [(point - end) / np.linalg.norm(point - end, axis=1)[:, None] for end in (self.raw.tx, self.raw.rx)]
        turns = (looks[0] + looks[1]) @ self.what.axes[1] / WAVE  # cycles/m
        y = np.linspace(0, 30, 3001)
        power = np.abs(np.exp(2j * np.pi * np.outer(y, turns - turns.mean())) @ weights) ** 2
        power /= power[0]
        first = int(np.argmax(np.diff(power) > 0))
        half = int(np.argmax(power < 0.5))
        edge = y[half - 1] + (y[1] - y[0]) * (power[half - 1] - 0.5) / (power[half - 1] - power[half])
        return 2 * float(edge), 10 * float(np.log10(power[first:].max()))

    def _clutter(self) -> list[Row]:
        """Level and contrast of the level ground between the cuboid and the cylinder."""
        made = self.what
        center = made.places(np.array(0.12 * made.swath[0]), np.array(0.0), np.array(scene.LEVEL))
        incidence = float(made.orbit.view(self.middle, center).incidence)
        weights = made.weights(self.raw, center)
        along = made.ground_speed * PRF / abs(float(self.view.doppler_rate(CENTER)))
        along *= float((weights**2).sum() / weights.sum() ** 2)
        cell = along * SLANT_CELL / np.sin(incidence)
        found = []
        for image in (self.fast, self.slow):
            x, y, _ = np.moveaxis(made.local(image.grid.positions), -1, 0)
            inside = (np.abs(x / made.swath[0] - 0.115) < 0.015) & (np.abs(y) < 0.2 * made.swath[1])
            power = np.abs(np.asarray(image.data)[inside] / image.gain) ** 2
            found.append((10 * np.log10(power.mean() / weights.mean() ** 2 / cell), power.std() / power.mean()))
        level, contrast = zip(*found, strict=True)
        return [
            _row("level ground, sigma0", "dB", 10 * np.log10(made.sigma0(incidence)), *level, ".2f"),
            _row("level ground, contrast of the intensity", "", 1.0, *contrast, ".2f"),
        ]

    def _solids(self) -> list[Row]:
        """Where the layover of each solid begins and its shadow ends, in ground range."""
        made, rows = self.what, []
        profiles = [self.profile(image) for image in (self.fast, self.slow)]
        for name, across in scene.SOLIDS.items():
            foot, _ = made.foot(across)
            begins, ends = made.edges(name, float(made.orbit.view(self.middle, foot).incidence))
            for what, edge in (("layover begins", begins), ("shadow ends", ends)):
                found = (step(x, power[name], edge - 45, edge + 45) for x, power in profiles)
                rows.append(_row(f"{name}, {what}", "m", edge, *found, ".0f"))
        return rows

    def profile(self, image: Any) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Ground ranges, m, and mean power through each solid there."""
        x, y, _ = np.moveaxis(self.what.local(image.grid.positions), -1, 0)
        power = np.abs(np.asarray(image.data)) ** 2
        edges = np.arange(-self.what.swath[0] / 2, self.what.swath[0] / 2, 3.0)
        out = {}
        for name, half in (("frustum", 15.0), ("cuboid", 35.0), ("cylinder", 15.0)):
            inside = (np.abs(y) < half) & np.isfinite(power)
            count = np.histogram(x[inside], edges)[0]
            out[name] = np.histogram(x[inside], edges, weights=power[inside])[0] / np.maximum(count, 1)
        return (edges[1:] + edges[:-1]) / 2, out

    def draw(self, folder: Path) -> None:
        """Pictures of the raw data and of both images."""
        from sarcl.figures import plots

        folder.mkdir(parents=True, exist_ok=True)
        delay, signal = self.signal.time_signal()
        image = self.fast
        half = np.array(self.what.swath) / 2
        terrain = np.where(np.isfinite(np.abs(self.slow.data)), np.abs(self.slow.data), 0)
        size = np.array(self.grid.shape) * self.what.pixel / 2
        for name, data, x, y, words in (
            ("raw", signal, delay[[0, -1]] * 1e6, (0, self.raw.n_rows), ("delay, us", "pulse")),
            ("range_doppler", image.data, image.grid.ranges[[0, -1]] / 1e3, (-half[1], half[1]),
             ("slant range, km", "azimuth, m")),
            ("backprojection", terrain, (-size[1], size[1]), (-size[0], size[0]), ("east, m", "north, m")),
        ):  # fmt: skip
            db = 20 * np.log10(np.maximum(np.abs(data), 1e-9 * np.abs(data).max()))
            db = np.minimum(db, np.percentile(db, 99.7))
            picture = plots.picture(db, tuple(x), y, *words, floor_db=-40.0)
            (folder / f"spaceborne-{name}.png").write_bytes(picture)


def step(x: np.ndarray, power: np.ndarray, low: float, high: float) -> float:
    """Where the mean of exponentially distributed powers changes between low and high: maximum likelihood."""
    inside = np.flatnonzero((x > low) & (x < high))
    p = np.maximum(power[inside], 1e-6 * power[inside].max())
    costs = [i * np.log(p[:i].mean()) + (len(p) - i) * np.log(p[i:].mean()) for i in range(3, len(p) - 2)]
    at = 3 + int(np.argmin(costs))
    return float(x[inside[at - 1]] + x[inside[at]]) / 2


def _row(item: str, unit: str, theory: float, fast: float | None, slow: float | None, digits: str) -> Row:
    fast, slow = (None if v is None else float(v) for v in (fast, slow))
    return {"item": item, "unit": unit, "theory": float(theory), "fast": fast, "slow": slow, "digits": digits}


def _number(text: str) -> float:
    return float(text.split()[0])


if __name__ == "__main__":
    main()
