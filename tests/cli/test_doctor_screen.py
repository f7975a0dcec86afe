"""sarcl doctor: one screen, its exit status, JSON, packages, and the limits of a process."""

import importlib.metadata
import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import sarcl
from sarcl.base import host_memory
from sarcl.cli.parser import main
from sarcl.opencl import doctor
from sarcl.opencl.doctor import Examination, Finding

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="control groups of Linux")
REQUIRED = ["numpy>=1.26", "scipy>=1.11", "tqdm", 'jax>=0.4; extra == "jax"', 'sgp4>=2.20; extra == "orbits"',
            'numpy>=2; extra == "orbits"', 'pytest>=8; extra == "test"', 'sarcl[jax]; extra == "dev"']  # fmt: skip


@pytest.fixture
def machine(monkeypatch):
    """The machine on which sarcl doctor runs: a device that works, packages, files of control groups, memory."""
    files = {"/proc/meminfo": "MemTotal: 9000000 kB\nMemAvailable: 8000000 kB\n", "/proc/self/cgroup": "0::/job"}
    here = SimpleNamespace(
        versions={"numpy": "2.4.6", "scipy": "1.17.1", "tqdm": "4.70.1", "sgp4": "2.23"}, files=files,
        found=Examination("libOpenCL.so", [("a.icd", "liba.so")], list(sarcl.devices()), [0], []),
    )  # fmt: skip

    def read(path, *options):
        if str(path) not in here.files:
            raise FileNotFoundError(path)
        return here.files[str(path)]

    def version(name):
        if name not in here.versions:
            raise importlib.metadata.PackageNotFoundError(name)
        return here.versions[name]

    monkeypatch.setattr(importlib.metadata, "requires", lambda name: REQUIRED)
    monkeypatch.setattr(importlib.metadata, "version", version)
    monkeypatch.setattr(Path, "read_text", read)
    monkeypatch.setattr(host_memory, "installed", lambda: 8e9)
    monkeypatch.setattr(os, "cpu_count", lambda: len(os.sched_getaffinity(0)))
    monkeypatch.setattr(doctor, "examine", lambda: here.found)
    monkeypatch.delenv("SARCL_THREADS", raising=False)
    return here


def screen(capsys, status=0):
    """Lines that sarcl doctor prints."""
    assert main(["doctor"]) == status
    return capsys.readouterr().out.splitlines()


def test_a_sound_machine_fits_on_one_screen(machine, capsys):
    lines = screen(capsys)
    assert len(lines) <= 24 and max(map(len, lines)) <= 100
    assert "numpy 2.4.6, scipy 1.17.1" in lines[1] and lines[2] == "extras  orbits; not installed: jax"
    assert any(line.startswith("device *0: ") and "works, " in line for line in lines)
    assert lines[-1] == "sarcl works here, on the device with a star"


def test_each_finding_has_its_remedy_below_and_long_lines_are_wrapped(machine, capsys):
    machine.found.findings = [Finding("w " * 80, "mend it"), Finding("b", "c", False)]
    machine.found.picked = []
    lines = screen(capsys, status=3)
    assert max(map(len, lines)) <= 100
    first = next(n for n, line in enumerate(lines) if line.startswith("1. w"))
    assert lines[first + 1].startswith("   w") and lines[first + 2] == "   -> mend it"
    assert lines[first + 4 : first + 6] == ["2. note: b", "   -> c"]
    assert "no device" in lines[-1]


def test_json_has_all_of_it(machine, capsys):
    machine.found.findings = [Finding("a", "b")]
    assert main(["doctor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["findings"][0] == {"what": "a", "remedy": "b", "is_fault": True}
    assert document["status"] == 0 and document["picked"] == [0] and document["devices"][0]["works"]
    assert document["packages"]["numpy"] == "2.4.6" and document["extras"] == {"jax": False, "orbits": True}


@pytest.mark.parametrize("version, text", [("1.9.3", "scipy>=1.11 (1.9.3)"), ("", "scipy>=1.11 (missing)")])
def test_a_package_that_is_old_or_missing_is_status_1_with_the_line_to_type(machine, capsys, version, text):
    machine.versions["scipy"] = version
    if not version:
        del machine.versions["scipy"]
    said = "\n".join(screen(capsys, status=1))
    assert f"packages that sarcl needs: {text}" in said and "-> pip install 'scipy>=1.11'" in said


def test_an_extra_with_an_old_package_is_not_installed(machine, capsys):
    machine.versions["numpy"] = "1.26.4"
    assert screen(capsys)[2] == "extras  none; not installed: jax, orbits"


@pytest.mark.parametrize("file", ["/sys/fs/cgroup/job/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"])
def test_a_limit_of_memory_is_found(machine, capsys, file):
    machine.files[file] = "500000000"
    assert any("may use 500 MB of memory, and 8.19 GB of the machine's are free" in line for line in screen(capsys))


def test_a_machine_whose_memory_is_in_use(machine, capsys):
    machine.files["/proc/meminfo"] = "MemAvailable: 100000 kB\n"
    assert any("102 MB of the machine's are free" in line for line in screen(capsys))


@pytest.mark.parametrize(
    "file, text", [("/sys/fs/cgroup/job/cpu.max", "50000 100000"), ("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "50000")]
)
def test_a_limit_of_processors_is_found(machine, capsys, file, text):
    machine.files[file] = text
    said = "\n".join(screen(capsys))
    assert "the container may use 0.5 processors" in said and "set SARCL_THREADS=1" in said


@pytest.mark.parametrize("text", ["max 100000", "-1", ""])
def test_a_control_group_without_a_limit_is_none(machine, capsys, text):
    machine.files |= {f"/sys/fs/cgroup/{name}": text for name in ("cpu.max", "memory.max", "job/cpu.max")}
    assert not any("note" in line for line in screen(capsys))


def test_few_threads_are_found(machine, capsys, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 512)
    assert any("bound to" in line and "of 512 processors" in line for line in screen(capsys))
    monkeypatch.setenv("SARCL_THREADS", "1")
    assert any("SARCL_THREADS=1, and there are 512 processors" in line for line in screen(capsys))
