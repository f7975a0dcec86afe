"""sarcl doctor: the machine, the packages and OpenCL on one screen, with the remedy of each fault."""

from __future__ import annotations

import json
import os
import platform
import re
import textwrap
from contextlib import suppress
from dataclasses import asdict
from importlib import metadata
from pathlib import Path

from ..base import host_memory
from ..base.text import size_text
from ..base.threads import threads
from ..base.version import __version__
from ..opencl import doctor
from ..opencl.doctor import Examination, Finding

COLUMNS = 100  # of the screen
SHOWN = ("numpy", "scipy", "pyopencl", "reikna")
OF_DEVELOPERS = ("test", "gpu-static", "dev", "site")  # extras that users of the package do not need
CGROUPS = Path("/sys/fs/cgroup")
CONCLUSIONS = {
    0: "sarcl works here, on the device with a star",
    1: "sarcl does not work here: packages are missing or too old",
    3: "sarcl does not work here: there is no device that it can use",
}  # by exit status


def run(as_json: bool) -> int:
    """Print what was found; 0 where sarcl can work, 1 where a package is missing or old, 3 where no device works."""
    versions, extras, wrong = _packages()
    examination = doctor.examine()
    examination.findings += [*wrong, *_of_memory(), *_of_threads()]
    status = 3 if not examination.picked else 1 if any(finding.is_fault for finding in wrong) else 0
    if as_json:
        document = {
            "status": status,
            "sarcl": __version__,
            "packages": versions,
            "extras": extras,
            **asdict(examination),
        }
        print(json.dumps(document | {"findings": [finding._asdict() for finding in examination.findings]}, indent=1))
    else:
        print("\n".join([*_summary(versions, extras), *_of_opencl(examination), "", CONCLUSIONS[status]]))
    return status


def _packages() -> tuple[dict[str, str], dict[str, bool], list[Finding]]:
    """Versions of the packages that sarcl needs, whether each extra is installed, and what is missing or too old."""
    versions: dict[str, str] = {}
    extras: dict[str, bool] = {}
    try:
        lines = metadata.requires("sarcl") or []
    except metadata.PackageNotFoundError:
        return {}, {}, [Finding("sarcl is not installed: its packages are not checked", "pip install it", False)]
    wrong: dict[str, str] = {}
    for line in lines:
        name, least, extra = re.findall(r"^([\w.-]+)[^;>]*(?:>=([\d.]+))?(?:.*extra == .([\w-]+))?", line)[0]
        version = _version(name)
        is_there = bool(version) and _numbers(version) >= _numbers(least)
        if not extra:
            versions[name] = version
            wrong |= {} if is_there else {f"{name}>={least}": version or "missing"}
        elif extra not in OF_DEVELOPERS:
            extras[extra] = extras.get(extra, True) and is_there
    texts = [f"{name} ({version})" for name, version in wrong.items()]
    remedy = f"pip install {' '.join(map(repr, wrong))}"
    return versions, extras, [Finding(f"packages that sarcl needs: {', '.join(texts)}", remedy)] if wrong else []


def _version(name: str) -> str:
    """Version of an installed package; "" where it is missing."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _numbers(version: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", version.partition("+")[0])]


def _of_memory() -> list[Finding]:
    """Little memory of the host, or of the container that this process is in."""
    limit = min([host_memory.installed(), *(n[0] for n in _limits("memory", "memory.max", "memory.limit_in_bytes"))])
    free = limit
    with suppress(OSError, IndexError):
        free = 1024.0 * int(re.findall(r"MemAvailable:\s*(\d+)", Path("/proc/meminfo").read_text())[0])
    if min(limit, free) >= doctor.LEAST_MEMORY:
        return []
    what = f"this process may use {size_text(limit)} of memory, and {size_text(free)} of the machine's are free"
    return [Finding(what, "end other programs, raise the container's limit, or pass a smaller max_bytes=", False)]


def _of_threads() -> list[Finding]:
    """Fewer processors than the machine has, or than sarcl starts threads."""
    try:
        number, processors = threads(), os.cpu_count() or 1
    except ValueError:  # of SARCL_THREADS: the device could not be opened, which says why
        return []
    # version 1 has the period, 1e5 us by default, in another file
    quotas = [n[0] / (n[1:] or [1e5])[0] for n in _limits("cpu", "cpu.max", "cpu.cfs_quota_us")]
    if (quota := min([*quotas, float("inf")])) < number:
        what = f"the container may use {quota:g} processors, and sarcl starts {number} threads"
        return [Finding(what, f"set SARCL_THREADS={max(1, int(quota))}, or raise the container's limit", False)]
    if number >= processors:
        return []
    if os.environ.get("SARCL_THREADS"):
        return [Finding(f"SARCL_THREADS={number}, and there are {processors} processors", "unset it to use all", False)]
    what = f"this process is bound to {number} of {processors} processors"
    return [Finding(what, "start it without taskset, or ask the batch system for more", False)]


def _limits(controller: str, *names: str) -> list[list[float]]:
    """Positive numbers in files of control groups, this process's and the topmost, of version 2 or 1."""
    groups, out = {""}, []
    with suppress(OSError):
        groups |= {line.split(":", 2)[2].lstrip("/") for line in Path("/proc/self/cgroup").read_text().splitlines()}
    for path in (CGROUPS / top / group / name for top in ("", controller) for group in groups for name in names):
        with suppress(OSError, ValueError):  # no such file; "max"
            numbers = [float(word) for word in path.read_text().split()]
            out += [numbers] if numbers and min(numbers) > 0 else []
    return out


def _summary(versions: dict[str, str], extras: dict[str, bool]) -> list[str]:
    """Lines on the machine and the packages."""
    packages = "".join(f", {name} {versions[name] or 'missing'}" for name in SHOWN if name in versions)
    installed, missing = (", ".join(name for name in extras if extras[name] == there) for there in (True, False))
    memory = size_text(host_memory.installed())
    return [
        f"machine {platform.system()} {platform.machine()}, {os.cpu_count()} processors, {memory} of memory",
        f"python  {platform.python_version()}, sarcl {__version__}{packages}",
        f"extras  {installed or 'none'}{f'; not installed: {missing}' if missing else ''}",
    ]


def _of_opencl(examination: Examination) -> list[str]:
    """Lines on loader, drivers and devices, and each finding with its remedy."""
    lines = [f"loader  {examination.loader or 'not known'}"]
    lines += [f"driver  {icd}: {library}" for icd, library in examination.drivers]
    for d in examination.devices:
        mark = "*" if d.index in examination.picked else " "
        state = f"works, {'' if d.fp64 else 'no '}float64" if d.works else "does not work"
        lines.append(f"device {mark}{d.index}: {d.name:.36}, {d.platform:.28}, {size_text(d.memory)}: {state}")
    for number, finding in enumerate(examination.findings, 1):
        what = f"{number}. {'' if finding.is_fault else 'note: '}{finding.what}"
        lines += ["", *_wrapped(what, "   "), *_wrapped(f"   -> {finding.remedy}", "      ")]
    return lines


def _wrapped(text: str, indent: str) -> list[str]:
    return textwrap.wrap(text, COLUMNS, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
