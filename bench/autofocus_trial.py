"""Autofocus on random scenes: correct data that it must not harm, smooth errors that it must remove, and scanning arms.

    python bench/autofocus_trial.py [-n 200] [--first 0] [--kind correct error arm] [--json FILE]

A scene is drawn from its kind and its seed: a straight track far away, a straight rail, or an arm that turns by 180
degrees, the last two with beams of 60 degrees; 1 to 40 points; perhaps clutter, noise, and a leak, which is an echo of
constant delay in every pulse, up to 20 dB above a point. Scenes of kind "error" also have 1 to 20 rad (largest value)
of a smooth phase.

Scenes of kind "error" are easier than the correct ones, on purpose, because an error that cannot be told from the
echoes is left alone, which harms nothing and restores nothing. Of them one in ten is an arm, instead of four in ten,
with twenty points or more and its beam given: on an arm neighbouring pulses must see targets in common. Rails have
three points or more. Leaks are at -10 dB or less: what every pulse sees of a leak is otherwise as good a target as the
points. An earlier draw, with arms as frequent as among the correct scenes and with fewer points, did not reach the
95 %. Scenes of kind "arm" show what becomes of the others: arms with an error, 1 to 40 points, and the beam given or
not. Most of these errors stay in the data; what is applied must harm nothing. Strong leaks in data that have an error
are in no scene: there most errors stay in the data.

The estimate is judged on the echo of each of the three brightest points alone, computed without any error but the one
added: what the correction does to the peak of its image, in dB, can then be told from noise, leak and neighbours. A
scene is harmed where one of the three peaks is lowered by more than 0.1 dB, distorted where a correction leaves two of
them displaced against one another by more than half a resolution cell, in or across range, and restored where the peak
of the brightest point is 0.5 dB or less below that without any error. By how much the error had displaced them before
is printed beside it: places that no pulse sees together keep that. CPU seconds are those of the process, user and
system.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import platform
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

KINDS = "correct", "error", "arm"
BEAM = np.radians(60)
HARMED, RESTORED = 0.1, 0.5  # dB
APART = 0.5  # resolution cells
# how often tracks are far, rails and arms: on an arm pulses see few targets in common, and errors are left alone
SHAPES = {"correct": (0.3, 0.3, 0.4), "error": (0.45, 0.45, 0.1), "arm": (0.0, 0.0, 1.0)}
COUNTS = 1, 2, 3, 5, 10, 20, 40  # points
# of scenes with an error: on an arm every pulse must see targets that its neighbours see
COUNTS_WITH_ERROR = {"far track": COUNTS, "rail": (3, 5, 10, 20, 40), "arm": (20, 40)}


@dataclass(frozen=True, eq=False)
class Scene:
    """Echoes of a random scene, and what is needed to judge a correction of them.

    raw      PhaseHistory with the error in it
    grid     ImageGrid over the points
    beam     of backproject, or None;  given  whether autofocus is given it
    error    rad (n_rows,), the phase that was added
    points   m (3, 3) or fewer, the brightest
    seen     amplitude of their echoes in every row (n_rows, 3)
    words    what the scene is
    """

    raw: sarcl.PhaseHistory
    grid: sarcl.ImageGrid
    beam: Any
    given: bool
    error: np.ndarray
    points: np.ndarray
    seen: np.ndarray
    words: str


def scene(kind: str, seed: int) -> Scene:
    """The scene of a kind, "correct", "error" or "arm", and a seed."""
    random = np.random.default_rng([KINDS.index(kind), seed])
    shape = str(random.choice(["far track", "rail", "arm"], p=SHAPES[kind]))
    if shape == "far track":
        n, carrier, bandwidth, samples = 128, 9.6e9, 300e6, 64
        tx = np.stack([np.full(n, -4000.0), np.linspace(-140, 140, n), np.full(n, 3000.0)], axis=1)
        tx += [0, random.uniform(-1000, 1000), 0]
        middle, size, pixel, heading = np.zeros(2), np.array([20.0, 20.0]), (0.25, 0.25), None
    else:
        n, carrier, bandwidth, samples = 192, 24e9, 1.5e9, 64
        if shape == "rail":
            tx = np.stack([np.zeros(n), np.linspace(-0.48, 0.48, n), np.zeros(n)], axis=1)
            heading = np.tile([1.0, 0, 0], (n, 1))
            middle, size, pixel = np.array([3.2, 0.0]), np.array([4.0, 3.0]), (0.05, 0.015)
        else:
            turn = np.linspace(-np.pi / 2, np.pi / 2, n)
            heading = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
            tx = 0.3 * heading
            middle, size, pixel = np.array([2.6, 0.0]), np.array([4.4, 7.0]), (0.05, 0.05)
    count = int(random.choice(COUNTS_WITH_ERROR[shape] if kind == "error" else COUNTS))
    places = np.zeros((count, 3))
    places[:, :2] = middle + random.uniform(-0.5, 0.5, (count, 2)) * size
    level = 10 ** (-random.uniform(0, 10, count) / 20)
    clutter = int(random.choice([0, 0, 400]))
    ground = np.zeros((clutter, 3))
    ground[:, :2] = middle + random.uniform(-0.5, 0.5, (clutter, 2)) * size
    weak = 10 ** (-random.uniform(20, 30) / 20)
    amplitudes = np.concatenate([level, np.full(clutter, weak)]) * _turns(random, count + clutter)
    away = np.linalg.norm(tx - [*middle, 0], axis=1)
    reference = away if heading is None else np.full(n, 3.0)
    raw, gains = _echoes(np.concatenate([places, ground]), amplitudes, tx, heading, reference, carrier, bandwidth,
                         samples)  # fmt: skip
    words = f"{shape}, {count} points" + (", clutter" if clutter else "")
    wave = np.asarray(raw.samples)
    if random.random() < (0.5 if kind == "correct" else 0.2):
        strength = 10 ** (random.uniform(*((-10, 20) if kind == "correct" else (-30, -10))) / 20)
        near = middle[0] - size[0] / 2 if heading is not None else away.min() - 3.0
        wave = wave + strength * _leak(raw, near + random.uniform(0, 0.5) * size[0])
        words += f", leak {20 * np.log10(strength):.0f} dB"
    noise = 10 ** (random.uniform(-40, 0) / 20)
    wave = wave + noise * (random.standard_normal(wave.shape) + 1j * random.standard_normal(wave.shape)) / np.sqrt(2)
    error = np.zeros(n)
    if kind != "correct":
        error = _smooth(random, n)
        words += f", error {abs(error).max():.1f} rad"
    raw = replace(raw, samples=(wave * np.exp(1j * error)[:, None]).astype(np.complex64))
    grid = sarcl.ImageGrid.plane(
        center=(*middle, 0), shape=tuple(int(s / p) + 1 for s, p in zip(size[::-1], pixel[::-1], strict=True)),
        spacing=pixel[::-1],
    )  # fmt: skip
    beam = None if heading is None else (BEAM, heading)
    # of the points that an eighth of the rows sees
    shown = level * (gains[:, :count] >= 10**-0.3).mean(axis=0).clip(max=0.125)
    best = np.argsort(-shown)[: min(3, int((shown > 0).sum()))]
    given = beam is not None and (random.random() < 0.5 or (kind == "error" and shape == "arm"))
    words += "" if heading is None else ", beam given" if given else ", beam not given"
    return Scene(raw, grid, beam, given, error, places[best], gains[:, best] * level[best], words)


def _turns(random: np.random.Generator, n: int) -> np.ndarray:
    return np.exp(2j * np.pi * random.random(n))


def _smooth(random: np.random.Generator, n: int) -> np.ndarray:
    """Two to eight falling cosines without slope, rad (n,), whose largest value is 1 to 20."""
    t = (np.arange(n) + 0.5) / n
    modes = int(random.integers(2, 9))
    curve = sum(random.standard_normal() / k * np.cos(np.pi * k * t) for k in range(1, modes + 1))
    curve = curve - np.polyval(np.polyfit(t, curve, 1), t)
    return np.asarray(curve * np.exp(random.uniform(0, np.log(20))) / np.abs(curve).max())


def _echoes(
    points: np.ndarray, amplitudes: np.ndarray, tx: np.ndarray, heading: np.ndarray | None, reference: np.ndarray,
    carrier: float, bandwidth: float, samples: int,
) -> tuple[sarcl.PhaseHistory, np.ndarray]:  # fmt: skip
    """The echo equation in float64, and the gain of the antenna, both ways, to every point (n_rows, n_points)."""
    step = bandwidth / samples
    first = carrier - (samples - 1) / 2 * step
    apart = points - tx[:, None]
    distance = np.linalg.norm(apart, axis=2)
    gains = np.ones(distance.shape)
    if heading is not None:  # -3 dB each way at the edges of the beam
        angle = np.arccos(np.clip((apart * heading[:, None]).sum(axis=2) / distance, -1, 1))
        gains = 10 ** (-0.6 * (2 * angle / BEAM) ** 2 / 2)
    delay = 2 * (distance - reference[:, None]) / SPEED_OF_LIGHT
    term, ramp = amplitudes * gains * np.exp(-2j * np.pi * first * delay), np.exp(-2j * np.pi * step * delay)
    wave = np.empty((len(tx), samples), np.complex128)
    for k in range(samples):
        wave[:, k] = term.sum(axis=1)
        term *= ramp
    raw = sarcl.PhaseHistory(wave.astype(np.complex64), frequency=first, frequency_step=step, tx=tx,
                             reference_range=reference)  # fmt: skip
    return raw, gains


def _leak(raw: sarcl.PhaseHistory, distance: float) -> np.ndarray:
    """Samples of an echo of the same delay in every pulse."""
    frequency = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    late = 2 * (distance - raw.reference_range[:, None]) / SPEED_OF_LIGHT
    return np.asarray(np.exp(-2j * np.pi * frequency * late))


def peaks(made: Scene, phase: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Height of the image of each point alone, whose echo has an error of `phase`, rad, and `shift`, m, per row."""
    return np.array([_peak(made, k, phase, shift)[0] for k in range(len(made.points))])


def places(made: Scene, phase: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Where the peaks of these images lie beside their points (n_points, 2): cells of each point, in and across range.

    What displaces the whole scene is left out, since no data show it: the least-squares fit of the phase by that of a
    displacement of the middle of the grid across range.
    """
    look = made.grid.bounds.mean(axis=0) - made.raw.tx
    look /= np.linalg.norm(look, axis=1)[:, None]
    turn = look - look.mean(axis=0)
    along = turn @ np.linalg.svd(turn, full_matrices=False)[2][0]
    phase = phase - phase.mean() - along * (along @ phase) / (along @ along)
    return np.array([_peak(made, k, phase, shift)[1] for k in range(len(made.points))])


def _peak(made: Scene, k: int, phase: np.ndarray, shift: np.ndarray) -> tuple[float, np.ndarray]:
    """Height of the image of a point alone, and cells, in and across range, by which its peak lies beside the point."""
    raw, point = made.raw, made.points[k]
    weight = made.seen[:, k]
    if made.beam is not None:
        toward = point - raw.tx
        toward = toward / np.linalg.norm(toward, axis=1)[:, None]
        weight = weight * ((toward * made.beam[1]).sum(axis=1) >= np.cos(BEAM / 2))
    used = np.flatnonzero(weight)
    if not len(used):
        return 0.0, np.zeros(2)
    tx, weight, phase, shift = raw.tx[used], weight[used], phase[used], shift[used]
    away = (point - tx)[:, :2]
    look = away.mean(axis=0) / np.linalg.norm(away.mean(axis=0))
    cross = np.array([-look[1], look[0]])
    wave = SPEED_OF_LIGHT / raw.center_frequency[0]
    turned = np.ptp((away / np.linalg.norm(point - tx, axis=1)[:, None]) @ cross)
    cells = np.array([SPEED_OF_LIGHT / 2 / raw.bandwidth[0], wave / 2 / max(turned, 1e-9)])
    reach, fine, at = np.array([2.0, 14.0]), 0.34, np.zeros(2)
    level = 0.0
    for _ in range(3):
        steps = [np.arange(-r, r + fine / 2, fine) for r in reach]
        offset = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2) + at
        spots = np.zeros((len(offset), 3))
        spots[:, :2] = (offset * cells) @ np.stack([look, cross])
        late = 2 * (np.linalg.norm(point + spots - tx[:, None], axis=2)
                    - np.linalg.norm(point - tx, axis=1)[:, None] - shift[:, None]) / SPEED_OF_LIGHT  # fmt: skip
        turn = 2 * np.pi * raw.center_frequency[0] * (late + 2 * shift[:, None] / SPEED_OF_LIGHT) + phase[:, None]
        value = np.abs((weight[:, None] * np.sinc(late * raw.bandwidth[0]) * np.exp(1j * turn)).sum(axis=0))
        best = int(value.argmax())
        at, level = offset[best], float(value[best])
        reach, fine = np.full(2, 1.2 * fine), fine / 4
    return level, at


def trial(kind: str, seed: int, **options: Any) -> dict[str, Any]:
    """What autofocus does with a scene: dB of the peaks against those without error, before and after, cells by which
    a correction leaves them apart, and by which the error itself had moved them, and the cost."""
    made = scene(kind, seed)
    start = time.process_time()
    _, errors = sarcl.autofocus(made.raw, made.grid, beam=made.beam if made.given else None, **options)
    seconds = time.process_time() - start
    zero = np.zeros(made.raw.n_rows)
    wanted = np.maximum(peaks(made, zero, zero), 1e-12)
    before = 20 * np.log10(np.maximum(peaks(made, made.error, zero) / wanted, 1e-6))
    after, apart, apart_before = before, 0.0, 0.0
    if errors.found:
        apart_before = np.ptp(places(made, made.error, zero), axis=0).max()
        apart = np.ptp(places(made, made.error - errors.phase, -errors.range), axis=0).max()
        after = 20 * np.log10(np.maximum(peaks(made, made.error - errors.phase, -errors.range) / wanted, 1e-6))
    return {
        "kind": kind,
        "seed": seed,
        "scene": made.words,
        "found": bool(errors.found),
        "gain": round(float(errors.gain), 3),
        "agreement": round(float(errors.agreement), 3),
        "before": [round(float(x), 2) for x in before],
        "after": [round(float(x), 2) for x in after],
        "apart": round(float(apart), 2),
        "apart_before": round(float(apart_before), 2),
        "harmed": bool((after - before).min() < -HARMED),
        "distorted": bool(apart > APART),
        "restored": bool(after[0] > -RESTORED),
        "seconds": round(seconds, 2),
    }


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """A line for each kind of scene."""
    lines = []
    for kind in KINDS:
        mine = [row for row in rows if row["kind"] == kind]
        if not mine:
            continue
        line = f"{kind}: {len(mine)} scenes, {sum(r['harmed'] for r in mine)} harmed by more than {HARMED} dB"
        apart = [r for r in mine if r["distorted"]]
        line += f", {len(apart)} with points left apart by more than {APART} cells"
        by_error = sum(r["apart"] - r["apart_before"] <= APART for r in apart)
        line += f" ({by_error} of them by the error, not the correction)"
        if kind != "correct":
            line += f", {sum(r['restored'] for r in mine)} with the peak within {RESTORED} dB"
        worst = min(min(np.subtract(r["after"], r["before"])) for r in mine)
        line += f", {sum(r['found'] for r in mine)} corrected"
        line += f"; points left apart by at most {max(r['apart'] for r in mine)} cells"
        line += f"; largest loss {max(-worst, 0):.2f} dB; {np.mean([r['seconds'] for r in mine]):.2f} CPU s each"
        lines.append(line)
    return lines


def main() -> None:
    """Run the trial, print a line per scene, and write the result."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("-n", type=int, default=200, help="scenes of each kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--json", type=Path, help="file of the result")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    rows = []
    for kind in options.kind:
        for seed in range(options.first, options.first + options.n):
            row = trial(kind, seed)
            rows.append(row)
            marks = (
                ("HARMED " if row["harmed"] else "")
                + ("DISTORTED " if row["distorted"] else "")
                + ("" if row["restored"] else "NOT RESTORED")
            )
            print(
                f"{kind} {seed}: {row['scene']}: {row['before']} -> {row['after']} dB, found {row['found']}, gain "
                f"{row['gain']}, agreement {row['agreement']}, apart {row['apart_before']} -> {row['apart']}, "
                f"{row['seconds']} s {marks}",
                flush=True,
            )
    for line in summary(rows):
        print(line)
    if options.json:
        content = {"kind": "autofocus", "summary": summary(rows), "scenes": rows,
                   "machine": {"system": platform.system(), "python": platform.python_version(),
                               "numpy": np.__version__, "processors": os.cpu_count()}}  # fmt: skip
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
