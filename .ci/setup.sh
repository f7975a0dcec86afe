#!/bin/sh
# Make this checkout ready to run: a virtual environment in .venv, the package in it (editable),
# and an OpenCL device that can build a kernel. POSIX sh; `make demo` and `make test` call it.
#
#   .ci/setup.sh [EXTRA] [GOAL]     EXTRA: test (default), dev, site or gpu-static; GOAL: the make goal to name in messages
#   PYTHON=/path/to/python3.12      the Python to build .venv from (3.11 or newer)
#
# A second run only looks. When it cannot go on it says in one paragraph what is missing and the
# exact line to type. It asks nothing, and needs nothing but apt's and pip's registries.
# Exit status: 0 ready, 1 something is missing, 3 no OpenCL device works.

set -eu
cd "$(dirname "$0")/.."
root=$(pwd -P)
extra=${1:-test}
goal=${2:-demo}
again="and then 'make $goal' again."

say() { printf 'sarcl: %s\n' "$*" >&2; }

# stop STATUS, with the paragraph on standard input
stop() {
    printf '\nsarcl: ' >&2
    cat >&2
    exit "$1"
}

# ---------------------------------------------------------------- packages of the distribution

become_root() {
    if [ "$(id -u)" = 0 ]; then
        as_root=
    elif command -v sudo >/dev/null 2>&1 && sudo -n true >/dev/null 2>&1; then
        as_root='sudo -n'
    else
        return 1
    fi
}

# Never asks, and waits for another apt (a fresh machine updating itself) to finish. Seen as it
# comes on a terminal, elsewhere only when it fails.
apt_get() {
    # shellcheck disable=SC2086 # two words, or none
    set -- $as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=180 "$@"
    if [ -t 2 ]; then
        "$@" </dev/null 9<&- >&2
    else
        words=$("$@" </dev/null 9<&- 2>&1) && return
        printf '%s\n' "$words" >&2
        return 1
    fi
}

# need_package STATUS PACKAGE WHY ELSEWHERE SIZE: installs PACKAGE, or stops and says how to
need_package() {
    if ! command -v apt-get >/dev/null 2>&1; then
        stop "$1" <<END
$3. This is not Debian or Ubuntu (there is no apt-get),
so nothing was installed. Install $4
with your package manager, $again
END
    fi
    if ! become_root; then
        stop "$1" <<END
$3, and installing packages needs root. Type

    sudo apt-get install -y $2

$again (Without root: see docs/guide/install.md.)
END
    fi
    say "installing $2 with apt ($5)"
    apt_get update || say "apt-get update failed; going on with the package lists that are here"
    apt_get install -y --no-install-recommends "$2" || stop "$1" <<END
$3, and apt-get could not install $2 (its
own words are above). It needs the distribution's package archive: check the network and apt's
sources (on Ubuntu the component 'universe'). Type

    ${as_root:+sudo }apt-get install -y $2

$again
END
}

installed() { dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q ' installed$'; }

# ---------------------------------------------------------------- Python

new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }
can_venv() { "$1" -c 'import venv, ensurepip' >/dev/null 2>&1; }
version() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || echo none; }

describe() {
    if ! command -v "$1" >/dev/null 2>&1; then
        echo "not a program that is here"
    elif [ "$(version "$1")" = none ]; then
        echo "not a Python that runs"
    else
        echo "Python $(version "$1")"
    fi
}

# Sets python: $PYTHON; else the first new enough one on PATH, those that can make environments first.
find_python() {
    python=${PYTHON:-}
    if [ -n "$python" ]; then
        new_enough "$python" && return
        stop 1 <<END
PYTHON=$python is $(describe "$python"); sarcl needs Python 3.11 or newer. Name another,
or leave PYTHON unset:

    make $goal PYTHON=/path/to/python3.12
END
    fi
    for name in python3 python3.15 python3.14 python3.13 python3.12 python3.11; do
        new_enough "$name" || continue
        if can_venv "$name"; then
            python=$name
            return
        fi
        python=${python:-$name}
    done
    [ -z "$python" ] || return 0
    if ! command -v python3 >/dev/null 2>&1; then
        need_package 1 python3-venv "there is no Python (python3) here" "Python 3.11 or newer, with its venv module," \
            "about 10 MB"
        python=python3
        new_enough python3 && return
    fi
    stop 1 <<END
python3 is $(describe python3); sarcl needs Python 3.11 or newer. On Ubuntu 22.04 type

    sudo apt-get install -y python3.11-venv

$again Elsewhere install a newer Python (python.org, pyenv, conda) and name it:

    make $goal PYTHON=/path/to/python3.12
END
}

# Debian keeps venv in a package of its own, named after the interpreter.
need_venv() {
    can_venv "$python" && return
    case ${python##*/} in
        python3 | python3.[0-9]*) package=${python##*/}-venv ;;
        *) package=python3-venv ;;
    esac
    need_package 1 "$package" "$python lacks the module that makes virtual environments" "Python's venv and ensurepip modules" \
        "about 3 MB"
    can_venv "$python" || stop 1 <<END
$python lacks the module that makes virtual environments, and the package $package
did not change that: it belongs to another Python. Name one that has venv and ensurepip:

    make $goal PYTHON=/path/to/python3.12
END
}

# ---------------------------------------------------------------- .venv with the package in it

inside=.venv/bin/python
unfinished=.venv/.sarcl-unfinished # there while we build: what an interrupted run leaves is not trusted
place=.venv/.sarcl-place           # scripts in .venv name their folder: a moved checkout needs a new one

stamp() {
    echo "$root"
    version $inside
    cat pyproject.toml .ci/setup.sh | cksum
}

other_python() { [ -n "${PYTHON:-}" ] && [ "$(version "$PYTHON")" != "$(version $inside)" ]; }

ready() {
    new_enough $inside && [ ! -e $unfinished ] && ! other_python &&
        [ "$(cat ".venv/.sarcl-$extra" 2>/dev/null)" = "$(stamp)" ]
}

has_pip() { $inside -m pip --version >/dev/null 2>&1 || $inside -m ensurepip >/dev/null 2>&1; }

# Why .venv has to be made, empty when the one that is there will do
why_make() {
    if [ ! -e .venv ] && [ ! -L .venv ]; then
        echo "making .venv"
    elif [ -e $unfinished ]; then
        echo "an earlier set-up was interrupted: making .venv anew"
    elif ! new_enough $inside; then
        echo "the Python in .venv does not run or is too old: making .venv anew"
    elif [ -e $place ] && [ "$(cat $place)" != "$root" ]; then
        echo "this folder has moved: making .venv anew"
    elif other_python; then
        echo "PYTHON is another version: making .venv anew"
    elif ! has_pip; then
        echo "there is no pip in .venv: making it anew"
    fi
}

make_venv() {
    find_python
    need_venv
    say "$1 ($python is $(describe "$python"))"
    rm -rf .venv
    mkdir .venv
    : >$unfinished
    "$python" -m venv .venv >&2 || stop 1 <<END
'$python -m venv .venv' failed (its own words are above). Name another Python:

    make $goal PYTHON=/path/to/python3.12
END
}

install_package() {
    if [ ! -w . ] || { [ -e .venv ] && [ ! -w .venv ]; }; then
        stop 1 <<END
'$root' (or .venv in it) cannot be written by $(id -un). Work in a copy
of your own, or, if root made .venv, type 'sudo rm -rf .venv', $again
END
    fi
    start=$(date +%s)
    why=$(why_make)
    [ -z "$why" ] || make_venv "$why"
    : >$unfinished
    say "installing sarcl and what it needs into .venv with pip (a minute or two the first time)"
    if [ -t 2 ]; then quiet=; else quiet=-q; fi
    # PIP_USER: a personal 'user = true' means nothing inside an environment and would stop pip.
    # PIP_USE_PEP517: older pips would build reikna, which comes as source, in a way they warn of.
    if ! PIP_USER=0 PIP_USE_PEP517=1 $inside -m pip install $quiet --disable-pip-version-check -e ".[$extra]" >&2; then
        rm -f $unfinished # pip gave up by itself and left things as they were
        stop 1 <<END
pip could not install what sarcl needs (its own words are above). It needs the Python package
registry (pypi.org, or the one pip's configuration names): check the network, the proxy
(https_proxy) and the free space, $again
END
    fi
    # A folder sarcl/ in the current one (this checkout, seen from above) would hide an editable package from Python; a
    # path entry is found before it.
    for folder in .venv/lib/python3*/site-packages; do
        if [ -d "$folder" ]; then printf '%s\n' "$root" >"$folder/sarcl-checkout.pth"; fi
    done
    for name in test "$extra"; do stamp >".venv/.sarcl-$name"; done
    printf '%s\n' "$root" >$place
    rm -f $unfinished
    say "the package is ready ($(($(date +%s) - start)) s)"
}

# ---------------------------------------------------------------- an OpenCL device

# True when a device works; else `sarcl doctor` says what is wrong and how to mend it, crashes of drivers included.
have_device() {
    status=0
    words=$(SARCL_DEVICE= $inside -m sarcl doctor 2>&1) || status=$?
    [ $status = 0 ] && return
    printf '%s\n' "$words" >&2
    [ $status = 3 ] && return 1
    stop 1 <<END
'.venv/bin/python -m sarcl doctor' failed (status $status, its words are above), so the package
itself does not start. Type 'make clean' $again
END
}

still_no_device() {
    stop 3 <<END
no OpenCL device here can build a kernel, although pocl-opencl-icd is installed. The list above says
why and what to do; docs/guide/install.md names other drivers. Do that, $again
END
}

need_device() {
    have_device && return
    if [ -n "${OCL_ICD_VENDORS:-}${OCL_ICD_FILENAMES:-}" ]; then # whatever we install would stay hidden
        stop 3 <<END
no OpenCL device here can build a kernel. The drivers looked at are only those named by
OCL_ICD_VENDORS='${OCL_ICD_VENDORS:-}' and OCL_ICD_FILENAMES='${OCL_ICD_FILENAMES:-}'. Type

    unset OCL_ICD_VENDORS OCL_ICD_FILENAMES
    sudo apt-get install -y pocl-opencl-icd     # unless it is installed

$again
END
    fi
    installed pocl-opencl-icd && still_no_device
    need_package 3 pocl-opencl-icd "no OpenCL device here can build a kernel" \
        "an OpenCL driver (PoCL for the
processor: the package is called pocl or pocl-opencl-icd; or the one of your graphics card)" \
        "about 110 MB to fetch, 600 MB of disk"
    have_device || still_no_device
}

# ---------------------------------------------------------------- compilers for GPUs that are not here

# Figures of kernels are recorded with these versions. Oclgrind, which runs kernels for tests, is no part of them: where
# there is none, its tests are skipped.
need_compilers() {
    for package in clang-19 libclc-19; do
        installed $package || need_package 1 $package "compiling kernels for GPUs that are not here needs $package" \
            "clang 19 with libclc" "about 100 MB with what it needs"
    done
    installed oclgrind || ! command -v apt-get >/dev/null 2>&1 || ! become_root ||
        apt_get install -y --no-install-recommends oclgrind ||
        say "apt-get could not install oclgrind; tests that run kernels under Oclgrind are skipped"
}

# ---------------------------------------------------------------- go

case $extra in
    test | dev | site | gpu-static) ;;
    *) echo "'$extra' is no extra of this package: test, dev, site or gpu-static" | stop 1 ;;
esac

# Two runs at once (make demo beside make test) take turns; the lock is this file, so nothing is left behind.
exec 9<.ci/setup.sh
if command -v flock >/dev/null 2>&1 && ! flock -n 9; then
    say "waiting for another set-up of this folder"
    flock 9
fi

ready || install_package
case $extra in
    gpu-static) need_compilers ;;
    site) ;; # pages are written without a device
    *) need_device ;;
esac
