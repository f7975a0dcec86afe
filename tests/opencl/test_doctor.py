"""What the doctor finds: faults of this machine made for real, and others as a child would see them."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import sarcl
from sarcl.opencl import doctor
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.doctor import Examination, Finding, View

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason=".icd files of Linux")
POCL = "Portable Computing Language"
VENDORS = Path(os.environ.get("OCL_ICD_VENDORS") or "/etc/OpenCL/vendors")


@pytest.fixture
def unset(monkeypatch):
    """No variable that hides devices or chooses one."""
    for name in (*doctor.HIDING, "SARCL_DEVICE", "SARCL_THREADS"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def vendors(tmp_path, unset, monkeypatch):
    """A folder with the .icd files of this machine, which OCL_ICD_VENDORS names."""
    if not VENDORS.is_dir() or not any(VENDORS.glob("*.icd")):
        pytest.skip("drivers of this machine have no .icd files in a known folder")
    for file in VENDORS.glob("*.icd"):
        shutil.copy(file, tmp_path)
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    return tmp_path


def the(found: Examination, words: str) -> Finding:
    """The one finding with these words."""
    (finding,) = [finding for finding in found.findings if words in finding.what]
    return finding


# ---- faults made for real


def test_a_machine_that_works_has_the_devices_of_sarcl_and_uses_the_same(unset):
    found = doctor.examine()
    assert found.devices == list(sarcl.devices())
    assert found.picked == [open_device().info.index]
    assert not [finding for finding in found.findings if "ends" in finding.what]


def test_a_placeholder_is_named_with_the_words_of_dlopen_and_the_other_drivers_work(vendors, tmp_path):
    (vendors / "other.icd").write_text("/nowhere/lib/libother.so")
    (vendors / "none.icd").touch()
    found = doctor.examine()
    placeholder = the(found, "/nowhere/lib/libother.so: cannot open shared object file: No such file")
    assert placeholder.is_fault and str(vendors / "other.icd") in placeholder.what + placeholder.remedy
    assert the(found, "names no library").is_fault
    assert found.picked


def test_a_driver_that_crashes_is_named_and_ends_no_process_but_a_child(vendors, tmp_path):
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    code = "#include <stdlib.h>\n__attribute__((constructor)) static void crash(void) { abort(); }"
    library = tmp_path / "libcrash.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-xc", "-", "-o", library], input=code, text=True, check=True)
    (vendors / "crash.icd").write_text(str(library))
    found = doctor.examine()
    fault = the(found, "names a library that cannot be loaded: SIGABRT")
    assert fault.is_fault and "crash.icd" in fault.what
    assert not found.picked and not found.devices


@pytest.mark.slow
def test_a_driver_that_hangs_is_ended(vendors, tmp_path):
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    code = "#include <unistd.h>\n__attribute__((constructor)) static void hang(void) { sleep(1000); }"
    library = tmp_path / "libhang.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-xc", "-", "-o", library], input=code, text=True, check=True)
    (vendors / "hang.icd").write_text(str(library))
    seen = doctor.view(patience=5.0)
    assert seen.end == "no answer within 5 s" and not seen.devices


@pytest.mark.slow
def test_a_folder_without_drivers_that_hides_those_of_the_machine(unset, tmp_path, monkeypatch):
    monkeypatch.setenv("OCL_ICD_VENDORS", str(tmp_path))
    found = doctor.examine()
    if found.devices:
        pytest.skip("this loader does not heed OCL_ICD_VENDORS")
    assert not found.picked
    assert the(found, "hides").remedy.startswith("unset OCL_ICD_VENDORS")
    assert not [finding for finding in found.findings if "apt-get" in finding.remedy]


def test_a_name_in_sarcl_device_that_no_device_has(unset, monkeypatch):
    monkeypatch.setenv("SARCL_DEVICE", "nothing")
    found = doctor.examine()
    assert not found.picked and any(device.works for device in found.devices)
    assert the(found, "SARCL_DEVICE='nothing' names no device that works").remedy.startswith("unset it")


@pytest.mark.slow
def test_a_variable_of_pocl_that_hides_its_devices(unset, monkeypatch):
    if not any(device.platform == POCL for device in sarcl.devices()):
        pytest.skip("no PoCL here")
    monkeypatch.setenv("POCL_DEVICES", "none")
    assert "POCL_DEVICES" in the(doctor.examine(), "POCL_DEVICES='none' hides").remedy


@pytest.mark.slow
def test_a_cache_folder_that_is_a_file(unset, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    found = doctor.examine()
    fault = the(found, "the cache folder")
    assert "File exists" in fault.what and "set XDG_CACHE_HOME" in fault.remedy and not fault.is_fault
    assert found.picked


@pytest.mark.slow
def test_a_path_without_ld(unset, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    found = doctor.examine()
    faults = [finding for finding in found.findings if "there is none on PATH" in finding.what]
    if not faults:
        pytest.skip("no PoCL here, or one that holds a linker of its own")
    assert "apt-get install binutils" in faults[0].remedy and "apt-get" not in faults[0].what


# ---- faults as a child would see them


def seen(device=None, **facts):
    """What a child sees on a machine with one device, which is opened."""
    devices = {} if device is None else {device.index: device}
    common = dict(step="open", platforms=[(d.platform, 1) for d in devices.values()], devices=devices,
                  picked=[i for i, d in devices.items() if d.works])  # fmt: skip
    return View(**{**common, **facts})


def examined(*trials, listings=()):
    """The examination of a machine of which children see this: those that try devices, and those that list them."""
    trials, listings, last = iter(trials), iter(listings), trials[-1]
    return doctor.examine(lambda *skipped, **options: next(listings if "until" in options else trials, last))


@pytest.fixture
def device(unset, monkeypatch, tmp_path):
    """A device of PoCL that works, on a machine without .icd files."""
    monkeypatch.setenv("OPENCL_VENDOR_PATH", str(tmp_path))
    info = replace(open_device().info, index=0, platform=POCL, driver="3.0-rc2", works=True, why="", fp64=True)
    return replace(info, memory=8 * 10**9)


def test_a_sound_device_gives_no_finding(device):
    assert examined(seen(device)).findings == []


@pytest.mark.parametrize(
    "broken, remedy",
    [("ImportError: libOpenCL.so.1: cannot open", "ocl-icd"), ("ImportError: no numpy", "install that package again")],
)
def test_a_package_that_cannot_be_imported(device, broken, remedy):
    found = examined(View(broken=broken))
    assert remedy in the(found, broken).remedy and len(found.findings) == 1


def test_no_driver_at_all(device):
    assert "apt-get install -y pocl-opencl-icd" in the(examined(seen()), "there is no OpenCL driver").remedy


def test_trials_that_end_their_process_leave_the_other_devices(device):
    first, second, other = (replace(device, index=i, works=i == 2, platform=f"P{i}") for i in range(3))
    crash = View(step="0", end="SIGABRT, LLVM ERROR: Cannot select", devices={0: first, 1: second})
    hang = View(step="1", end="no answer within 60 s", devices=crash.devices)
    found = examined(crash, hang, seen(other, devices={**crash.devices, 2: other}, end="SIGABRT", picked=[]))
    assert "its trial ends the process: SIGABRT, LLVM ERROR" in the(found, "device 0").what
    assert "its trial ends the process: no answer within 60 s" in the(found, "device 1").what
    assert "set SARCL_DEVICE=2" in the(found, "the choice of a device ends every program").remedy


def test_a_trial_that_ends_its_process_leaves_no_empty_program_in_the_cache_of_pocl(device, tmp_path, monkeypatch):
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    for name, contents in (("AB/SOUND", b"BC"), ("CD/EMPTY", b"")):
        (tmp_path / name / "compute").mkdir(parents=True)
        (tmp_path / name / "program.bc").write_bytes(contents)
    first = replace(device, works=False)
    examined(View(step="0", end="SIGABRT", devices={0: first}), seen(devices={0: first}, picked=[]))
    assert [path.name for path in tmp_path.glob("*/*")] == ["SOUND"]


@pytest.mark.parametrize("platform, wheel, word", [
    (POCL, "3.0", "pip uninstall pocl-binary-distribution"), (POCL, "2.0", "update its driver"),
    (POCL, "", "update its driver"), ("Other", "3.0", "update its driver"),
])  # fmt: skip
def test_a_wheel_of_pocl_that_builds_nothing(device, monkeypatch, platform, wheel, word):
    def version(name):
        if not wheel:
            raise importlib.metadata.PackageNotFoundError(name)
        return wheel

    monkeypatch.setattr(importlib.metadata, "version", version)
    bad = replace(device, platform=platform, works=False, why="unknown target CPU 'generic'")
    found = examined(seen(bad))
    assert word in the(found, "does not work: unknown target CPU 'generic'").remedy and not found.picked


def test_a_device_that_works_with_empty_caches_alone(device):
    bad = replace(device, works=False, why="built a program without kernels")
    assert "delete the caches" in the(examined(seen(bad), seen(device)), "without kernels").remedy


def test_a_device_without_float64_and_with_little_memory(device):
    found = examined(seen(replace(device, fp64=False, memory=5 * 10**8)))
    assert "shadows=False" in the(found, "has no float64").remedy
    assert "500 MB of memory" in the(found, "of memory").what
    assert not any(finding.is_fault for finding in found.findings)


def test_two_versions_of_one_driver(device):
    other = replace(device, index=1, driver="3.1")
    found = examined(seen(device, devices={0: device, 1: other}, platforms=[(POCL, 1), (POCL, 1)]))
    assert "3.0-rc2 and 3.1" in the(found, f"2 drivers of {POCL}").what


def test_a_device_that_cannot_be_opened(device):
    refused = "SARCL_THREADS is 'x'; give a whole number"
    found = examined(seen(device, picked=[], refused=refused))
    assert the(found, "SARCL_THREADS is 'x'").remedy == "give a whole number"


@pytest.mark.parametrize(
    "end, words", [("SIGSEGV", "ends every program that loads it: SIGSEGV"), ("", "lists no device")]
)
def test_a_driver_that_loads_and_lists_nothing(device, tmp_path, end, words):
    (tmp_path / "card.icd").write_text("libc.so.6")  # a library that can be loaded
    found = examined(seen(), listings=[seen(), View(step="load", end=end)])
    assert "card.icd" in the(found, words).what


def test_drivers_that_crash_only_together(device, tmp_path):
    (tmp_path / "card.icd").write_text("libc.so.6")
    found = examined(View(step="load", end="SIGSEGV"), listings=[seen(), seen(device)])
    assert "OCL_ICD_VENDORS to the .icd file of one driver" in the(found, "OpenCL ends every program").remedy


def test_the_time_of_a_child_is_limited():
    assert doctor.view(patience=0.01).end == "no answer within 0.01 s"
