"""Each extra alone, and the lower bounds of dependencies, in empty environments outside this folder.

    python .ci/extras.py [EXTRA ...]     default: all but jax and torch, which are large
    python .ci/extras.py --lowest        the quick tests of some rooms with the lower bound of every dependency

The wheel is installed, then one extra after the other, each removed before the next, and a few lines use what the extra
promises. The same lines without the extra must end with an error that names it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
START = """
import numpy as np, sarcl
track = sarcl.Trajectory.line(start=(500, -2, 300), velocity=(0, 1, 0), prf=4.0, n_pulses=16)
chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=60e6, duration=1e-6)
scene = sarcl.Scene.points([[0, 0, 0]])
grid = sarcl.ImageGrid.plane(shape=(8, 8), spacing=1.0)
raw = sarcl.echo(scene, chirp, track)
image = sarcl.backproject(raw, grid)
"""
CHECKS = {
    "dask": """
try:
    from distributed import Client
    client = Client(n_workers=1, threads_per_worker=1, dashboard_address=None)
except ImportError:
    client = object()
far = sarcl.backproject(raw, grid, cluster=client)
assert np.array_equal(far.data, image.data)
""",
    "formats": """
words = dict(
    CollectorName="simulator", CoreName="a point", ModeType="SPOTLIGHT", CollectionStart="2026-05-01T12:00:00",
    Classification="UNCLASSIFIED", ReleaseInfo="UNRESTRICTED", ImageArea=((-12, -10), (12, 10)),
)
raw.save("a.cphd", origin=(47.2, 8.5, 420.0), metadata=words)
assert sarcl.read("a.cphd").n_rows == raw.n_rows
""",
    "jax": """
f = sarcl.linear.Echoes(grid, raw).jax()
assert f(np.ones(64, np.complex64)).shape == (raw.n_rows * raw.n_samples,)
""",
    "maps": """
there = sarcl.ImageGrid.on_map("EPSG:32632", bounds=(500000, 5200000, 500020, 5200020), spacing=1.0)
center = there.positions.reshape(-1, 3).mean(0)
tx = center * 1.0001 + np.arange(4)[:, None]
reference = np.linalg.norm(tx - center, axis=1)
seen = sarcl.PhaseHistory(np.ones((4, 16)), frequency=9e9, frequency_step=1e6, tx=tx, reference_range=reference)
sarcl.backproject(seen, there, tolerance=1e-1).save("a.tif")
""",
    "orbits": """
orbit = sarcl.Orbit.tle(
    "1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991",
    "2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482",
)
assert np.isfinite(orbit.positions(0.0)).all()
""",
    "plots": """
from sarcl.figures import plots
plots.require("a page")
assert plots.png(plots.figure()).startswith(b"\\x89PNG")
""",
    "pylops": """
import pylops
A = pylops.aslinearoperator(sarcl.linear.Echoes(grid, raw))
assert (A @ np.ones(64, np.complex64)).shape == (raw.n_rows * raw.n_samples,)
""",
    "torch": """
f = sarcl.linear.Echoes(grid, raw).torch()
import torch
assert f(torch.ones(64, dtype=torch.complex64)).shape == (raw.n_rows * raw.n_samples,)
""",
    "xarray": """
assert image.to_xarray()["data"].shape == (8, 8)
for name in ("a.zarr", "a.nc"):
    image.save(name)
    assert np.array_equal(sarcl.read(name).data, image.data)
""",
}
LARGE = "jax", "torch"
SILENT = "pylops"  # its own import is what fails
ROOMS = "model io cli/test_cli.py imaging/test_backproject.py simulation/test_echo.py simulation/test_facet_echo.py"


def pip(python: Path, *words: str) -> str:
    """Output of pip in the environment of `python`."""
    command = [python, "-m", "pip", *words, "--disable-pip-version-check"]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def environment(folder: Path, *requirements: str) -> Path:
    """An environment with these packages; its Python."""
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    pip(python, "install", "-q", *requirements)
    return python


def run(python: Path, extra: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What the extra promises, tried in a new folder outside of the checkout."""
    folder.mkdir()
    code = f"{START}if __name__ == '__main__':" + CHECKS[extra].replace("\n", "\n    ")
    (folder / "check.py").write_text(code)  # a file, which processes of workers can import
    settings = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([python, "check.py"], cwd=folder, env=settings, capture_output=True, text=True)


def alone(extras: list[str], scratch: Path) -> list[str]:
    """The extras that fail alone, or whose absence is not told. What an extra brought is removed before the next."""
    pip(Path(sys.executable), "wheel", "-q", "--no-deps", "-w", str(scratch), str(ROOT))
    shutil.rmtree(ROOT / "build", ignore_errors=True)
    wheel = next(scratch.glob("sarcl-*.whl"))
    python, failed = environment(scratch / "environment", str(wheel)), []
    packages = set(pip(python, "freeze").splitlines())
    for extra in extras:
        without = run(python, extra, scratch / f"{extra}_missing")
        wanted = extra if extra in SILENT else f"sarcl[{extra}]"
        told = without.returncode != 0 and wanted in without.stderr.strip().splitlines()[-1]
        pip(python, "install", "-q", f"{wheel}[{extra}]")
        done = run(python, extra, scratch / f"{extra}_there")
        print(f"{extra}: {'works' if done.returncode == 0 else done.stderr}", flush=True)
        if not told:
            print(f"{extra}: its absence is not told: {without.stderr or 'no error'}")
        if done.returncode or not told:
            failed.append(extra)
        brought = set(pip(python, "freeze").splitlines()) - packages
        pip(python, "uninstall", "-q", "-y", *(line.partition("==")[0] for line in brought))
    return failed


def lowest(scratch: Path) -> int:
    """Status of the tests of ROOMS with the lower bound of every dependency; each bound is printed."""
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    bounds = [re.sub(r"\s*>=\s*", "==", line) for line in dependencies]
    print(*bounds, flush=True)
    tools = "pytest", "pytest-xdist", "sybil", "setuptools", "pyproj", "shapely", "sgp4"
    python = environment(scratch / "lowest", *bounds, *tools, "-e", str(ROOT))
    tests = [f"tests/{room}" for room in ROOMS.split()]
    settings = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run([python, "-m", "pytest", "-q", "-n", "2", *tests], cwd=ROOT, env=settings).returncode


def main(words: list[str]) -> int:
    """0 where all that was asked for works."""
    unknown = set(words) - {*CHECKS, "--lowest"}
    if unknown:
        raise SystemExit(f"unknown: {', '.join(sorted(unknown))}; there are --lowest, {', '.join(CHECKS)}")
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        if words == ["--lowest"]:
            return lowest(scratch)
        failed = alone(words or [extra for extra in CHECKS if extra not in LARGE], scratch)
    if failed:
        print(f"extras that fail: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
