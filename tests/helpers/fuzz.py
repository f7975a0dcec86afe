"""Mutated files, each read in a forked process: what is right, refused in words, wrong, crashed or hung.

A case is a number: `mutated(data, seed)` gives the same bytes every time, so that a failure is repeated by its seed.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import re
import resource
import signal
import warnings
from collections import Counter
from collections.abc import Callable, Iterable

import numpy as np

LARGE = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)
DIGITS = b'0123456789-+.eE ,\n"[]{}='
EXTREMES = (
    "0", "1", "-1", "-0.0", "1e400", "1e-320", "nan", "inf", "9" * 25, "2147483648", "1e9", "true", '""', "[]", "",
)  # fmt: skip
NUMBER, WORD = re.compile(r"[-+]?\d[\d.]*(?:[eE][-+]?\d+)?"), re.compile(r"\w+")
PATIENCE = 10  # s for one file; these files are read in milliseconds
MEMORY = 2**31  # bytes that reading one file may take, beyond what the process has
REFUSALS = (ValueError, TypeError, OSError, MemoryError)


def mutated(data: bytes, seed: int) -> bytes:
    """`data` with one to four changes: bits, bytes, words of extreme values, digits, pieces cut, repeated or moved.

    Of text every other case remains text, so that parsers hand it on: numbers, words and lines are changed.
    """
    rng = np.random.default_rng(seed)
    changes = 1 + int(rng.geometric(0.6)) % 4
    if seed % 2 and data.isascii():
        text = data.decode()
        for _ in range(changes):
            text = _changed_text(text, rng)
        return text.encode()
    out = bytearray(data)
    for _ in range(changes):
        n = max(len(out), 1)
        at, length = int(rng.integers(n)), int(min(2 ** rng.integers(0, 8), n))
        kind = int(rng.integers(10))
        if kind <= 1 and out:
            out[at] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            out[at : at + length] = rng.bytes(length)
        elif kind <= 4:
            size = int(rng.choice([1, 2, 4, 8]))
            value = LARGE[int(rng.integers(len(LARGE)))] & (256**size - 1)
            out[at : at + size] = value.to_bytes(size, str(rng.choice(["little", "big"])))
        elif kind == 5:
            del out[at : at + length]
        elif kind == 6:
            out[at:at] = out[int(rng.integers(n)) :][:length]
        elif kind >= 8:
            out[at : at + 1] = bytes([int(rng.choice(list(DIGITS)))])
        elif rng.random() < 0.3:
            del out[at:]
        else:
            to = int(rng.integers(n))
            out[to : to + length] = out[at : at + length]
    return bytes(out)


def _changed_text(text: str, rng: np.random.Generator) -> str:
    """`text` with an extreme number, another digit, a line more or less, or a word in the place of another."""

    def any_of(found: list[re.Match[str]]) -> re.Match[str]:
        return found[int(rng.integers(len(found)))]

    kind, numbers, words = int(rng.integers(4)), list(NUMBER.finditer(text)), list(WORD.finditer(text))
    if kind <= 1 and numbers:
        begin, end = any_of(numbers).span()
        if kind == 0:
            return text[:begin] + str(rng.choice(EXTREMES)) + text[end:]
        at = int(rng.integers(begin, end))
        return text[:at] + str(rng.choice(list("0123456789-.e"))) + text[at + 1 :]
    if kind == 2 and words:
        begin, end = any_of(words).span()
        return text[:begin] + any_of(words).group() + text[end:]
    lines = text.split("\n")
    if rng.random() < 0.5:
        del lines[int(rng.integers(len(lines)))]
    else:
        lines.insert(int(rng.integers(len(lines))), lines[int(rng.integers(len(lines)))])
    return "\n".join(lines)


def outcomes(
    cases: Iterable[int], judge: Callable[[int], str], heard: Callable[[int, str], object] = lambda case, said: None
) -> Counter[str]:
    """How often each outcome: what judge(case) returns, and "crashed: ..." or "hung: ..." with the number of the case.

    heard  called with each case and its outcome, in this process
    judge runs in forked processes, which are ended where a case takes longer than PATIENCE.
    """
    waiting, found = list(cases), Counter[str]()
    while waiting:
        done, status = _in_child(waiting, judge)
        found.update(done)
        if status:
            what = "hung" if status == signal.SIGALRM else f"crashed by signal {status}"
            found[f"{what}: case {waiting[len(done)]}"] += 1
            done = [*done, what]
        for case, said in zip(waiting, done, strict=False):
            heard(case, said)
        waiting = waiting[len(done) :]
    return found


def _in_child(cases: list[int], judge: Callable[[int], str]) -> tuple[list[str], int]:
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of forks of processes with threads
        child = os.fork()
    if child == 0:
        os.close(reading)
        faulthandler.disable()  # crashes are counted, not printed
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        warnings.simplefilter("ignore")
        for case in cases:
            signal.alarm(PATIENCE)
            text = pickle.dumps(judge(case)[:300])
            os.write(writing, len(text).to_bytes(4, "little") + text)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as file:
        said = file.read()
    found, at = [], 0
    while at < len(said):
        size = int.from_bytes(said[at : at + 4], "little")
        found.append(pickle.loads(said[at + 4 : at + 4 + size]))
        at += 4 + size
    return found, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) * -1


def refusal(exc: BaseException, name: str) -> str:
    """ "refused" for an error that users can act on and that names the file; else what is wrong with it."""
    if not isinstance(exc, REFUSALS):
        return f"bare {type(exc).__name__}: {exc}"
    return "refused" if name in str(exc) else f"nameless {type(exc).__name__}: {exc}"
