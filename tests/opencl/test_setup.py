"""`make demo` on machines that lack something: the real .ci/setup.sh among stand-in programs, no network.

Each test builds a machine of stand-ins (python3, apt-get, sudo, id, dpkg-query) in a folder that is the
whole PATH, and reads what the script says, what it calls and with which status it ends.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(
    not (ROOT / ".ci" / "setup.sh").exists() or shutil.which("sh") is None,
    reason="a checkout on a Unix machine",
)

TOOLS = "sh cat cksum date dirname env grep mkdir rm true".split()

# The real interpreter for `-c`, with another version or without ensurepip; and stand-ins for `-m venv`,
# `-m pip` and `-m sarcl doctor`, which note the call and end as the files in $STATE say.
PYTHON = """#!/bin/sh
case "$1 $2" in
"-m venv")
    echo "venv" >>"$STATE/calls"
    mkdir -p "$3/bin" && cat "$0" >"$3/bin/python" && exec {chmod} +x "$3/bin/python" ;;
"-m pip")
    [ "$3" = --version ] && exit 0
    echo "pip $3" >>"$STATE/calls"
    rm "$STATE/kill" 2>/dev/null && kill -9 $PPID
    exit "$(cat "$STATE/pip" 2>/dev/null || echo 0)" ;;
"-m ensurepip") exit 1 ;;
"-m sarcl")
    status=$(cat "$STATE/devices" 2>/dev/null || echo 0)
    echo "list of the doctor, status $status"
    exit "$status" ;;
esac
[ -e "$STATE/no venv" ] && hide="sys.modules['ensurepip'] = None"
exec {real} -I -S -c "import sys; sys.version_info = {version}; ${{hide:-}}
exec(sys.argv[1])" "$2"
"""

APT = """#!/bin/sh
echo "apt-get $* DEBIAN_FRONTEND=$DEBIAN_FRONTEND" >>"$STATE/calls"
[ -e "$STATE/no network" ] && { echo "E: Unable to fetch some archives"; exit 100; }
case "$*" in
*python3-venv) rm -f "$STATE/no venv" ;;
*pocl-opencl-icd) rm -f "$STATE/devices" ;;
esac
"""


class Machine:
    """A folder of programs and a checkout; `has` and `lacks` change it, `setup` runs the script."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.bin = folder / "bin"
        self.state = folder / "state"
        self.checkout = folder / "a check out"  # with spaces, as in "My Documents"
        for each in (self.bin, self.state, self.checkout / ".ci"):
            each.mkdir(parents=True)
        for name in TOOLS:
            found = shutil.which(name)
            assert found is not None, f"this machine has no {name}"
            (self.bin / name).symlink_to(found)
        shutil.copy(ROOT / ".ci" / "setup.sh", self.checkout / ".ci")
        shutil.copy(ROOT / "pyproject.toml", self.checkout)
        self.user(1000)
        self.program("apt-get", APT)
        self.program("dpkg-query", '#!/bin/sh\ncat "$STATE/installed" 2>/dev/null\n')
        self.python()

    def program(self, name: str, text: str) -> None:
        (self.bin / name).write_text(text)
        (self.bin / name).chmod(0o755)

    def python(self, version: str = "(3, 12, 1)", name: str = "python3") -> None:
        self.program(name, PYTHON.format(real=f"'{sys.executable}'", version=version, chmod=shutil.which("chmod")))

    def user(self, number: int) -> None:
        self.program("id", f'#!/bin/sh\n[ "$1" = -u ] && echo {number} || echo somebody\n')

    def has(self, state: str, text: str = "") -> None:
        (self.state / state).write_text(text)

    def setup(self, *arguments: str, **environment: str) -> tuple[int, str]:
        """Status and output of .ci/setup.sh."""
        done = subprocess.run(
            ["sh", str(self.checkout / ".ci" / "setup.sh"), *arguments],
            env={"PATH": str(self.bin), "STATE": str(self.state), **environment},
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=60,
        )
        return done.returncode, done.stdout

    def calls(self) -> list[str]:
        """What the stand-ins were called with since the last look."""
        path = self.state / "calls"
        lines = path.read_text().splitlines() if path.exists() else []
        path.unlink(missing_ok=True)
        return lines


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_a_machine_that_has_all_is_set_up_once_and_then_only_looked_at(machine):
    status, said = machine.setup()
    assert (status, machine.calls()) == (0, ["venv", "pip install"]), said
    status, said = machine.setup()
    assert (status, said, machine.calls()) == (0, "", [])


def test_a_changed_pyproject_is_installed_again_into_the_same_environment(machine):
    machine.setup()
    machine.calls()
    with open(machine.checkout / "pyproject.toml", "a") as file:
        file.write("# changed\n")
    assert machine.setup()[0] == 0
    assert machine.calls() == ["pip install"]


def test_the_dev_extra_is_installed_when_first_asked_for_and_serves_the_tests_too(machine):
    machine.setup("test")
    machine.calls()
    assert machine.setup("dev", "lint")[0] == 0
    assert machine.calls() == ["pip install"]
    machine.setup("test")
    machine.setup("dev")
    assert machine.calls() == []


def test_an_old_python_stops_with_the_line_that_installs_a_newer_one(machine):
    machine.python("(3, 10, 12)")
    status, said = machine.setup("test", "test")
    assert status == 1
    assert "python3 is Python 3.10; sarcl needs Python 3.11 or newer" in said
    assert "\n    sudo apt-get install -y python3.11-venv\n" in said
    assert "\n    make test PYTHON=/path/to/python3.12\n" in said
    assert machine.calls() == [] and not (machine.checkout / ".venv").exists()


def test_a_newer_python_beside_an_old_one_is_found(machine):
    machine.python("(3, 10, 12)")
    machine.python("(3, 13, 0)", name="python3.13")
    status, said = machine.setup()
    assert status == 0 and "python3.13 is Python 3.13" in said


@pytest.mark.parametrize("version, word", [("(3, 9, 0)", "Python 3.9"), (None, "not a program that is here")])
def test_a_python_named_by_hand_that_will_not_do_is_refused(machine, version, word):
    if version:
        machine.python(version, name="mine")
    status, said = machine.setup(PYTHON="mine")
    assert status == 1 and f"PYTHON=mine is {word}" in said and "make demo PYTHON=/path/to/python3.12" in said


def test_a_python_named_by_hand_of_another_version_remakes_the_environment(machine):
    machine.setup()
    machine.calls()
    machine.python("(3, 13, 0)", name="mine")
    status, said = machine.setup(PYTHON="mine")
    assert status == 0 and "PYTHON is another version" in said
    assert machine.calls() == ["venv", "pip install"]
    machine.setup(PYTHON="mine")
    machine.setup()
    assert machine.calls() == []


def test_no_python_at_all_stops_with_the_line_that_installs_it(machine):
    (machine.bin / "python3").unlink()
    status, said = machine.setup()
    assert status == 1 and "there is no Python (python3) here" in said
    assert "\n    sudo apt-get install -y python3-venv\n" in said and "'make demo' again" in said


def test_a_python_without_venv_stops_with_the_line_when_we_are_not_root(machine):
    machine.has("no venv")
    status, said = machine.setup()
    assert status == 1
    assert "\n    sudo apt-get install -y python3-venv\n" in said and "'make demo' again" in said
    assert machine.calls() == []


def test_root_installs_venv_without_asking(machine):
    machine.user(0)
    machine.has("no venv")
    status, said = machine.setup()
    assert status == 0, said
    update, install, *rest = machine.calls()
    assert "update" in update
    assert "install -y --no-install-recommends python3-venv DEBIAN_FRONTEND=noninteractive" in install
    assert rest == ["venv", "pip install"]


def test_no_device_stops_with_one_paragraph_when_we_are_not_root(machine):
    machine.has("devices", "3")
    status, said = machine.setup("test", "demo")
    assert status == 3
    paragraph = said[said.index("sarcl: no OpenCL device") :]
    assert "no OpenCL device here can build a kernel" in paragraph
    assert "\n    sudo apt-get install -y pocl-opencl-icd\n" in paragraph and "'make demo' again" in paragraph
    assert "list of the doctor" in said  # why each device was passed over
    assert not any("apt-get" in call for call in machine.calls())


def test_no_device_is_said_again_and_quickly_on_the_next_run(machine):
    machine.has("devices", "3")
    machine.setup()
    machine.calls()
    assert machine.setup()[0] == 3
    assert machine.calls() == []


def test_root_installs_a_device_without_asking(machine):
    machine.user(0)
    machine.has("devices", "3")
    status, said = machine.setup()
    assert status == 0, said
    apt = [call for call in machine.calls() if call.startswith("apt-get")]
    assert "update" in apt[0] and "DEBIAN_FRONTEND=noninteractive" in apt[0]
    assert "install -y --no-install-recommends pocl-opencl-icd DEBIAN_FRONTEND=noninteractive" in apt[1]


def test_sudo_is_used_where_it_needs_no_password(machine):
    machine.program("sudo", '#!/bin/sh\n[ "$1" = -n ] || exit 1\nshift\necho "sudo -n" >>"$STATE/calls"\nexec "$@"\n')
    machine.has("devices", "3")
    status, said = machine.setup()
    assert status == 0, said
    calls = machine.calls()
    assert calls.index("sudo -n") < calls.index(next(call for call in calls if "pocl-opencl-icd" in call))


def test_sudo_that_wants_a_password_is_not_used(machine):
    machine.program("sudo", '#!/bin/sh\necho "sudo: a password is required" >&2\nexit 1\n')
    machine.has("devices", "3")
    status, said = machine.setup()
    assert status == 3 and "sudo apt-get install -y pocl-opencl-icd" in said and "password is required" not in said


def test_apt_without_network_says_what_it_needs(machine):
    machine.user(0)
    machine.has("devices", "3")
    machine.has("no network")
    status, said = machine.setup()
    assert status == 3
    assert "E: Unable to fetch" in said and "apt-get could not install pocl-opencl-icd" in said
    assert "package archive" in said and "\n    apt-get install -y pocl-opencl-icd\n" in said


def test_another_distribution_is_told_what_kind_of_package_is_missing(machine):
    machine.user(0)
    (machine.bin / "apt-get").unlink()
    machine.has("devices", "3")
    status, said = machine.setup()
    assert status == 3 and "not Debian or Ubuntu" in said and "OpenCL driver" in said and "pocl" in said


def test_a_folder_of_drivers_that_hides_the_others_is_named_and_nothing_is_installed(machine):
    machine.user(0)
    machine.has("devices", "3")
    status, said = machine.setup(OCL_ICD_VENDORS="/empty folder")
    assert status == 3 and "OCL_ICD_VENDORS='/empty folder'" in said
    assert "\n    unset OCL_ICD_VENDORS OCL_ICD_FILENAMES\n" in said
    assert "\n    sudo apt-get install -y pocl-opencl-icd " in said
    assert not any("apt-get" in call for call in machine.calls())


def test_pocl_that_is_installed_but_does_not_work_is_not_installed_again(machine):
    machine.user(0)
    machine.has("devices", "3")
    machine.has("installed", "install ok installed")
    status, said = machine.setup()
    assert status == 3 and "although pocl-opencl-icd is installed" in said and "docs/guide/install.md" in said
    assert not any("apt-get" in call for call in machine.calls())


def test_a_package_that_does_not_start_is_shown(machine):
    machine.has("devices", "1")
    status, said = machine.setup()
    assert status == 1 and "list of the doctor, status 1" in said and "make clean" in said


def test_pip_without_network_says_what_it_needs_and_the_next_run_goes_on(machine):
    machine.has("pip", "1")
    status, said = machine.setup()
    assert status == 1 and "needs the Python package\nregistry" in said and "'make demo' again" in said
    assert machine.calls() == ["venv", "pip install"]
    machine.has("pip", "0")
    assert machine.setup()[0] == 0
    assert machine.calls() == ["pip install"]


def test_a_set_up_that_was_killed_starts_anew(machine):
    machine.has("kill")
    assert machine.setup()[0] == -9
    machine.calls()
    status, said = machine.setup()
    assert status == 0 and "an earlier set-up was interrupted" in said
    assert machine.calls() == ["venv", "pip install"]


@pytest.mark.parametrize(
    "damage, said",
    [
        (lambda venv: (venv / "bin" / "python").unlink(), "does not run"),
        (lambda venv: (venv / "bin" / "python").write_text("#!/nowhere/python\n"), "does not run"),
        (lambda venv: (venv / ".sarcl-unfinished").touch(), "interrupted"),
        (lambda venv: (shutil.rmtree(venv), venv.symlink_to("nowhere")), "does not run"),
    ],
    ids=["python gone", "python broken", "interrupted", "dangling link"],
)
def test_a_half_made_environment_is_made_anew(machine, damage, said):
    machine.setup()
    machine.calls()
    damage(machine.checkout / ".venv")
    status, output = machine.setup()
    assert status == 0 and said in output
    assert machine.calls() == ["venv", "pip install"]


def test_a_checkout_that_has_moved_gets_a_new_environment(machine):
    machine.setup()
    machine.calls()
    machine.checkout = machine.checkout.rename(machine.folder / "elsewhere")
    status, said = machine.setup()
    assert status == 0 and "has moved" in said
    assert machine.calls() == ["venv", "pip install"]


@pytest.mark.skipif(os.getuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_named(machine):
    machine.checkout.chmod(0o555)
    status, said = machine.setup()
    machine.checkout.chmod(0o755)
    assert status == 1 and "cannot be written by somebody" in said


def test_compilers_for_gpus_are_installed_without_asking_where_we_are_root(machine):
    machine.user(0)
    status, said = machine.setup("gpu-static", "gpu-static")
    assert status == 0, said
    words = " ".join(machine.calls()).split()
    assert {"clang-19", "libclc-19", "oclgrind"} <= set(words)


def test_compilers_for_gpus_that_are_missing_are_named_with_the_line_that_installs_them(machine):
    status, said = machine.setup("gpu-static", "gpu-static")
    assert status == 1 and "sudo apt-get install -y clang-19" in said and "'make gpu-static' again" in said


def test_an_unknown_extra_is_refused(machine):
    status, said = machine.setup("tests")
    assert status == 1 and "'tests' is no extra of this package: test, dev, site or gpu-static" in said


@pytest.mark.parametrize("script, shell", [(".ci/setup.sh", "sh"), (".ci/run", "bash")])
def test_the_scripts_parse(script, shell):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell}")
    subprocess.run([shell, "-n", str(ROOT / script)], check=True)
