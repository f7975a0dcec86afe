"""Accuracy of full-wave echoes: spheres against Mie's series, and problems of the Austin RCS Benchmark Suite.

    SARCL_DATA=... python bench/full_wave_accuracy.py [mie] [almond] [sphere] [--cells 12] [--device ...]

mie     monostatic echoes of conducting spheres in steps of ka 0.1
almond  problem IIIA at 7 GHz, azimuths of 0 to 180 degrees in steps of 15, against its reference
sphere  problem IA at 320 MHz: a diameter of 20.5 wavelengths, bistatic angles in steps of 1 degree; 1.2 GB, minutes
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

DISTANCE = 1e5  # m, of antennas: waves are plane over the targets


def echoes(
    device: Any, cell: float, triangles: np.ndarray, radius: float, top: float, k: np.ndarray, sent: np.ndarray,
    travel: np.ndarray, towards: np.ndarray, received: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Amplitudes (P, F) of a closed conductor about the origin, by one run.

    radius  m: half the sides of a cube that holds it, or of a box (3,);  top  rad/m, of the incident pulse
    k  rad/m (F,);  sent  polarisation;  travel  of the incident wave
    towards, received  directions from the origin to receivers, and their polarisations, unit vectors (P, 3)
    """
    from sarcl.base.constants import SPEED_OF_LIGHT
    from sarcl.fullwave import runs
    from sarcl.fullwave.lattice import lattice_around

    grid = lattice_around(-np.ones(3) * radius, np.ones(3) * radius, cell, runs.MARGIN)
    band = np.array([0.05, 1]) * top * SPEED_OF_LIGHT / (2 * np.pi)
    place = -DISTANCE * travel / np.linalg.norm(travel)
    target = runs.target_of(grid, [(triangles, None)], top)
    (made,), _ = runs.run(
        device, grid, target, (float(band[0]), float(band[1])), k, anchor=runs.Anchor(place, sent),
        antennas=runs.Antennas(np.broadcast_to(place, towards.shape), DISTANCE * towards, received[None]),
        options=runs.RunOptions(max_bytes=4e9),
    )  # fmt: skip
    return np.asarray(made[:, 0])


def ball(radius: float, facets: int) -> np.ndarray:
    """A geodesic mesh with the volume of a sphere about the origin."""
    from sarcl import shapes

    made = shapes.sphere(radius, facets=facets, rotation=(0.3, 0.5, -0.2)).triangles
    return np.asarray(made * (4 * np.pi / 3 * radius**3 / (np.linalg.det(made).sum() / 6)) ** (1 / 3))


def mie(device: Any) -> None:
    """Monostatic echoes of spheres."""
    from sarcl.reference.mie import conducting_sphere

    print("| ka up to | cells per wavelength | direction of travel | rms, dB | complex error, rms | largest | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for top, cells, along in (
        (4, 10, (0, 0, -1)), (4, 10, (0.5, -0.3, -0.8)), (10, 10, (0, 0, -1)), (10, 10, (0.5, -0.3, -0.8)),
        (10, 20, (0.5, -0.3, -0.8)),
    ):  # fmt: skip
        started = time.process_time()
        k, travel = np.arange(0.5, top + 0.01, 0.1), np.array(along) / np.linalg.norm(along)
        sent = np.cross(travel, [0.2, 1, 0.1])
        sent /= np.linalg.norm(sent)
        cell = 2 * np.pi / top / cells
        got = echoes(device, cell, ball(1.0, 20_000), 1.0, top, k, sent, travel, -travel[None], sent[None])[0]
        wanted = np.array([conducting_sphere(1.0, one)[0] for one in k])
        off, level = np.abs(got / wanted - 1), 20 * np.log10(np.abs(got / wanted))
        rms, complex_rms = np.sqrt((level**2).mean()), 100 * np.sqrt((off**2).mean())
        print(f"| {top} | {cells} | {along} | {rms:.3f} | {complex_rms:.2f} % | {100 * off.max():.1f} % | "
              f"{time.process_time() - started:.0f} |", flush=True)  # fmt: skip


def almond(device: Any, folder: Path, cells: float) -> None:
    """Monostatic echoes of the NASA almond at 7 GHz."""
    from published.test_almond import almond as shape

    from sarcl.base.constants import SPEED_OF_LIGHT

    triangles, k = shape().triangles, np.array([2 * np.pi * 7e9 / SPEED_OF_LIGHT])
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    triangles, half = triangles - (low + high) / 2, (high - low) / 2
    print(f"\nNASA almond, 7 GHz, {cells:g} cells per wavelength: difference in dB\n")
    print("| azimuth, degrees | VV | HH |\n|---|---|---|")
    off = []
    for azimuth in range(0, 181, 15):
        c, s = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
        towards, row = np.array([c, s, 0]), []
        for name, sent in (("V", np.array([0, 0, 1.0])), ("H", np.array([-s, c, 0]))):
            cell = 2 * np.pi / k[0] / cells
            got = echoes(device, cell, triangles, half, 1.15 * k[0], k, sent, -towards, towards[None], sent[None])
            table = np.loadtxt(folder / "IIIA" / f"ref_rcs.III.A.s1.fx3.{name}.txt")
            wanted = table[np.isclose(table[:, 2], azimuth), 3][0]
            row.append(20 * np.log10(abs(got[0, 0])) - wanted)
        off.append(row)
        print(f"| {azimuth} | {row[0]:.2f} | {row[1]:.2f} |", flush=True)
    print("| mean size | {:.2f} | {:.2f} |".format(*np.abs(off).mean(axis=0)))


def sphere(device: Any, folder: Path, cells: float) -> None:
    """Bistatic echoes of a sphere of 20.5 wavelengths by one run, in both planes."""
    from sarcl.base.constants import SPEED_OF_LIGHT

    radius, k, started = 9.6, np.array([2 * np.pi * 320e6 / SPEED_OF_LIGHT]), time.process_time()
    travel = np.array([1, 2, 4]) / np.sqrt(21)  # the dispersion along it is about the mean over directions
    sent = np.cross(travel, [0, 0, 1.0])
    sent /= np.linalg.norm(sent)
    across = np.cross(travel, sent)
    tables = [np.loadtxt(folder / "IA" / f"ref_rcs.I.A.s7.f6.{name}.txt")[:1801:10] for name in "VH"]
    angle = np.radians(tables[0][:, 2])[:, None]  # from the transmitter's direction
    towards = np.concatenate([side * np.sin(angle) - travel * np.cos(angle) for side in (across, sent)])
    received = np.concatenate([np.tile(sent, (len(angle), 1)), np.cross(across, towards[len(angle) :])])
    cell = 2 * np.pi / k[0] / cells
    got = echoes(device, cell, ball(radius, 80_000), radius, 1.15 * k[0], k, sent, travel, towards, received)[:, 0]
    print(f"\nAustin IA, diameter {2 * radius * k[0] / (2 * np.pi):.1f} wavelengths, {cells:g} cells per wavelength, "
          f"{time.process_time() - started:.0f} CPU s")  # fmt: skip
    for name, table, part in zip("VH", tables, np.split(got, 2), strict=True):
        size = np.abs(20 * np.log10(np.abs(part)) - table[:, 3])
        print(f"{name}: mean size of the difference {size.mean():.3f} dB, rms {np.sqrt((size**2).mean()):.3f} dB, "
              f"largest {size.max():.2f} dB at {np.degrees(angle[size.argmax(), 0]):.0f} degrees")  # fmt: skip


def main() -> None:
    """Print the tables that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", default=["mie"], metavar="part", help="mie, almond, sphere")
    parser.add_argument("--cells", type=float, default=12, help="per wavelength, of almond and sphere")
    parser.add_argument("--device")
    asked = parser.parse_args()

    from sarcl.opencl.choose_device import open_device

    device, folder = open_device(asked.device), Path(os.environ.get("SARCL_DATA", "data")) / "austin_rcs"
    for part in asked.parts:
        if part == "mie":
            mie(device)
        elif part == "almond":
            almond(device, folder, asked.cells)
        else:
            sphere(device, folder, asked.cells)


if __name__ == "__main__":
    main()
