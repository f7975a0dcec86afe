"""Autofocus on measured data with a known error added, on measured arc scans as they are, and on a large case.

    SARCL_DATA=../shared/data python bench/autofocus_measured.py [gotcha arcs large]

gotcha  AFRL Gotcha, pass 1, azimuth 1-2 deg, HH, without its autofocus fields: 234 pulses, 100 x 100 m at 0.2 m. A
        seeded smooth phase is added and removed. The table compares the brightest reflector with that of the data as
        they are, by `sarcl.measure` on a patch of its own
arcs    outdoor scans of a TI AWR1642 on an arm that turns by 180 degrees, beams of 60 degrees, 400 pulses of 256
        samples: what autofocus does to the highest pixel
large   1536 pulses of 2048 samples: 60 points in noise with 10 rad of smooth error from a far arc, on 442 x 442 pixels,
        and 40 points before an arm with beams of 60 degrees

CPU seconds are those of the process, user and system.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.model.phase_history import PhaseHistory

DATA = Path(os.environ.get("SARCL_DATA", "../shared/data"))
BEAM = np.radians(60)
ARM, FIRST, SLOPE, RATE = 0.212, 77.154e9, 39.058e12, 2652e3  # m, Hz, Hz/s, Hz: of the arc scans


def smooth(n: int, seed: int, modes: int, **scale: float) -> np.ndarray:
    """A sum of falling cosines without slope, rad (n,), of a given `rms` or `peak`."""
    random = np.random.default_rng(seed)
    t = np.linspace(0, 1, n)
    return scaled(sum(random.standard_normal() / k * np.cos(np.pi * k * t) for k in range(1, modes + 1)), **scale)


def scaled(curve: Any, rms: float = 0.0, peak: float = 0.0) -> np.ndarray:
    """A curve without its straight line, of a given rms or largest value."""
    t = np.arange(len(curve))
    curve = curve - np.polyval(np.polyfit(t, curve, 1), t)
    return np.asarray(curve * (rms / np.sqrt((curve**2).mean()) if rms else peak / np.abs(curve).max()))


def with_phase(raw: PhaseHistory, phase: np.ndarray) -> PhaseHistory:
    """raw times exp(j phase)."""
    return replace(raw, samples=(np.asarray(raw.samples) * np.exp(1j * phase)[:, None]).astype(np.complex64))


def with_motion(raw: PhaseHistory, phase: np.ndarray) -> PhaseHistory:
    """raw from a platform too far away by what causes the phase in the middle of the band."""
    middle = (raw.n_samples - 1) / 2
    center = raw.frequency[0] + middle * raw.frequency_step[0]
    shift = -SPEED_OF_LIGHT * phase / (4 * np.pi * center)
    away = raw.frequency_step[:, None] * (np.arange(raw.n_samples) - middle)
    turn = np.exp(1j * phase[:, None] - 4j * np.pi / SPEED_OF_LIGHT * away * shift[:, None])
    return replace(raw, samples=(np.asarray(raw.samples) * turn).astype(np.complex64))


def run(raw: PhaseHistory, grid: sarcl.ImageGrid, **options: Any) -> tuple[sarcl.PhaseHistory, Any, float]:
    """Result of autofocus, and CPU seconds."""
    start = time.process_time()
    better, errors = sarcl.autofocus(raw, grid, **options)
    return better, errors, time.process_time() - start


def response(raw: PhaseHistory, grid: sarcl.ImageGrid) -> Any:
    """Point response of the brightest point, on a patch of its own."""
    assert grid.spacing is not None
    level = np.abs(sarcl.backproject(raw, grid, tolerance=1e-3).data)
    at = grid.at(*(int(i) for i in np.unravel_index(level.argmax(), level.shape)))
    patch = sarcl.ImageGrid.plane(center=at, shape=(161, 161), spacing=min(grid.spacing) / 2)
    return sarcl.measure(sarcl.backproject(raw, patch, tolerance=1e-3), near=at)


def gotcha() -> None:
    """Table of known errors that were added to measured data."""
    raw = sarcl.read(sorted((DATA / "gotcha").glob("*.mat")))
    assert isinstance(raw, PhaseHistory)
    grid, n = sarcl.ImageGrid.plane(shape=(500, 500), spacing=0.2), raw.n_rows
    walk = np.cumsum(np.random.default_rng(5).standard_normal(n))
    walk -= np.polyval(np.polyfit(np.arange(n), walk, 1), np.arange(n))
    motion = smooth(n, 4, 8, rms=10)
    cases = {
        "none": raw,
        "10 rad peak, 3 cosines": with_phase(raw, smooth(n, 0, 3, peak=10)),
        "10 rad peak, 20 cosines": with_phase(raw, smooth(n, 1, 20, peak=10)),
        "10 rad rms, 3 cosines": with_phase(raw, smooth(n, 2, 3, rms=10)),
        "10 rad rms, 20 cosines": with_phase(raw, smooth(n, 3, 20, rms=10)),
        f"motion of 10 rad rms, {1e3 * motion.std() * SPEED_OF_LIGHT / (4 * np.pi * 9.6e9):.0f} mm":
            with_motion(raw, motion),
        "random walk, 1 rad per pulse": with_phase(raw, walk),
    }  # fmt: skip
    wanted = response(raw, grid)

    def db(other: Any) -> float:
        return float(20 * np.log10(abs(other) / abs(wanted.peak)))

    print("| error | blurred | peak | IRW, range and cross | cosines | agreement | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for name, case in cases.items():
        blurred = np.abs(sarcl.backproject(case, grid, tolerance=1e-3).data).max()
        plain = np.abs(sarcl.backproject(raw, grid, tolerance=1e-3).data).max()
        better, errors, seconds = run(case, grid)
        got = response(better, grid)
        ratio = ", ".join(f"{a / b:.3f}" for a, b in zip(got.irw, wanted.irw, strict=True))
        print(
            f"| {name} | {20 * np.log10(blurred / plain):.1f} dB | {db(got.peak):+.2f} dB | {ratio} | {errors.modes} | "
            f"{errors.agreement:.2f} | {seconds:.1f} |", flush=True,
        )  # fmt: skip


def arc_scan(number: int) -> PhaseHistory:
    """An outdoor scan; the sense of the arm's turn is not documented, and does not matter here."""
    path = DATA / "arc_sar_77ghz" / f"Prova_Esterna_{number}.bin"
    words = np.fromfile(path, np.int16).reshape(-1, 2, 2).astype(np.float32)
    wave = (words[:, 0] + 1j * words[:, 1]).reshape(-1, 256).conj()
    step = SLOPE / RATE
    reference = SPEED_OF_LIGHT / (4 * step)  # half of the unambiguous range: the window begins at the arm
    frequency = FIRST + step * np.arange(256)
    wave = wave * np.exp(4j * np.pi / SPEED_OF_LIGHT * frequency * reference)
    return sarcl.PhaseHistory(
        wave.astype(np.complex64), frequency=FIRST, frequency_step=step, tx=ARM * heading(len(wave)),
        reference_range=reference,
    )  # fmt: skip


def heading(n: int) -> np.ndarray:
    """Directions in which an arm points that turns by 180 degrees (n, 3)."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, n)
    return np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)


def arcs() -> None:
    """Measured arc scans, as they are."""
    grid = sarcl.ImageGrid.plane(center=(4.5, 0, 0), shape=(180, 160), spacing=0.05)
    for number in (7, 8, 10):
        raw = arc_scan(number)
        beam = (float(BEAM), heading(raw.n_rows))
        for given in (None, beam):
            better, errors, seconds = run(raw, grid, beam=given)
            levels = [np.abs(sarcl.backproject(r, grid, beam=beam).data).max() for r in (raw, better)]
            print(
                f"arc scan {number}, beam {'not ' if given is None else ''}given: found {errors.found}, gain "
                f"{errors.gain:.3f}, agreement {errors.agreement:.2f}, highest pixel "
                f"{20 * np.log10(levels[1] / levels[0]):+.2f} dB, {seconds:.1f} CPU s. {errors.reason}", flush=True,
            )  # fmt: skip


def echoes(points: np.ndarray, tx: np.ndarray, reference: Any, carrier: float, bandwidth: float,
           lit: np.ndarray | None = None) -> PhaseHistory:  # fmt: skip
    """The echo equation for unit points, 2048 samples per pulse; lit (n_rows, n_points): which pulses see a point."""
    samples = 2048
    step = bandwidth / samples
    first = carrier - (samples - 1) / 2 * step
    wave = np.zeros((len(tx), samples), np.complex128)
    for k, point in enumerate(points):
        away = np.linalg.norm(tx - point, axis=1) - reference
        turn = np.exp(-4j * np.pi / SPEED_OF_LIGHT * away * step)
        term = np.exp(-4j * np.pi / SPEED_OF_LIGHT * away * first) * (1 if lit is None else lit[:, k])
        powers = np.cumprod(np.broadcast_to(turn[:, None], (len(tx), 64)), axis=1) / turn[:, None]
        for start in range(0, samples, 64):
            wave[:, start : start + 64] += (term * turn**start)[:, None] * powers
    random = np.random.default_rng(1)
    noise = random.standard_normal(wave.shape) + 1j * random.standard_normal(wave.shape)
    return sarcl.PhaseHistory(
        (wave + noise).astype(np.complex64), frequency=first, frequency_step=step, tx=tx, reference_range=reference
    )


def large() -> None:
    """1536 pulses of 2048 samples."""
    n, random = 1536, np.random.default_rng(0)
    error = smooth(n, 1, 8, rms=10)
    angle = np.radians(2) * np.linspace(-0.5, 0.5, n)
    far = 5e3 * np.stack([-np.cos(angle) * np.cos(0.6), np.sin(angle) * np.cos(0.6), np.full(n, np.sin(0.6))], axis=1)
    points = random.uniform(-40, 40, (60, 3)) * (1, 1, 0)
    raw = with_phase(echoes(points, far, 5e3, 9.6e9, 600e6), error)
    _, errors, seconds = run(raw, sarcl.ImageGrid.plane(shape=(442, 442), spacing=0.2))
    print(f"far arc: found {errors.found}, gain {errors.gain:.3f}, {seconds:.1f} CPU s", flush=True)
    direction = heading(n)
    tx = ARM * direction
    places = np.stack([random.uniform(2, 8, 40), random.uniform(-5, 5, 40), np.zeros(40)], axis=1)
    away = places - tx[:, None]
    lit = (away * direction[:, None]).sum(axis=2) > np.cos(BEAM / 2) * np.linalg.norm(away, axis=2)
    raw = echoes(places, tx, 5.0, 77e9, 3.7e9, lit)
    grid = sarcl.ImageGrid.plane(center=(5, 0, 0), shape=(442, 442), spacing=0.024)
    for given in (None, (float(BEAM), direction)):
        _, errors, seconds = run(raw, grid, beam=given)
        print(
            f"arm, as it is, beam {'not ' if given is None else ''}given: found {errors.found}, "
            f"gain {errors.gain:.3f}, {seconds:.1f} CPU s", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    for part in sys.argv[1:] or ["gotcha", "arcs", "large"]:
        {"gotcha": gotcha, "arcs": arcs, "large": large}[part]()
