"""The progress bar: drawn on terminals and in notebooks only, and only for long stages."""

import io
import itertools
import os
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from sarcl.base import progress
from sarcl.base.progress import Bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    """A terminal that can erase a line, and a clock by which stages are drawn from their first step."""
    stream = Terminal()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=itertools.count(0, 2.0).__next__))
    return stream


def work(bar, steps=100, stage="backproject"):
    for done in range(steps + 1):
        bar(stage, done, steps)


def screen(text):
    """What a terminal's last line shows after `text`."""
    return text.split("\r")[-1].replace("\x1b[K", "").strip()


def test_a_stage_shorter_than_a_second_draws_nothing(terminal, monkeypatch):
    monkeypatch.setattr(progress, "time", time)
    work(Bar(terminal))
    assert terminal.getvalue() == ""


def test_a_longer_stage_shows_its_part_rate_and_time_left(terminal):
    bar = Bar(terminal)
    bar("backproject", 0, 1000)
    bar("backproject", 500, 1000)
    shown = screen(terminal.getvalue())
    assert shown.startswith("backproject  50% |############") and "/s" in shown and shown.endswith(" left")


@pytest.mark.parametrize("end", [lambda bar: bar("echo", 10, 10), lambda bar: bar("image", 0, 10), Bar.wipe])
def test_the_line_is_empty_when_a_stage_ends_the_next_begins_or_text_is_printed(terminal, end):
    bar = Bar(terminal)
    bar("echo", 0, 10)
    bar("echo", 5, 10)
    assert screen(terminal.getvalue())
    end(bar)
    assert screen(terminal.getvalue()) == ""


def test_a_stage_continues_after_its_line_was_erased(terminal):
    bar = Bar(terminal)
    bar("echo", 0, 10)
    bar("echo", 5, 10)
    bar.wipe()
    bar("echo", 6, 10)
    assert screen(terminal.getvalue()).startswith("echo  60%")


def test_ctrl_c_leaves_the_line_empty(terminal):
    with pytest.raises(KeyboardInterrupt), Bar(terminal) as bar:
        bar("echo", 0, 10)
        bar("echo", 5, 10)
        assert screen(terminal.getvalue())
        raise KeyboardInterrupt
    assert screen(terminal.getvalue()) == ""


def test_many_steps_are_drawn_rarely(terminal):
    work(Bar(terminal), steps=10_000)
    assert terminal.getvalue().count("left") <= 20  # ten a second


@pytest.mark.parametrize("stream", [io.StringIO(), None])
def test_nothing_is_drawn_where_stderr_is_no_terminal(terminal, monkeypatch, stream):
    monkeypatch.setattr(sys, "stderr", stream)
    work(Bar())
    assert stream is None or stream.getvalue() == ""


def test_nothing_is_drawn_on_a_terminal_that_cannot_erase_a_line(terminal, monkeypatch):
    monkeypatch.setenv("TERM", "dumb")
    work(Bar(terminal))
    assert terminal.getvalue() == ""


def test_a_lost_terminal_costs_no_result(terminal):
    class Lost(Terminal):
        def write(self, text):
            raise OSError(5, "Input/output error")

    work(Bar(Lost()))
    closed = Terminal()
    closed.close()
    work(Bar(closed))


@pytest.mark.skipif(os.name != "posix", reason="opens a pseudo-terminal")
@pytest.mark.parametrize("columns", [0, 60])
def test_a_real_terminal_shows_the_line_even_where_it_does_not_know_its_width(terminal, columns):
    import fcntl
    import struct
    import termios

    far, near = os.openpty()
    fcntl.ioctl(near, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    with os.fdopen(near, "w") as stream, Bar(stream) as bar:
        bar("echo", 0, 10)
        bar("echo", 5, 10)
        shown = os.read(far, 1000).decode()
    os.close(far)
    assert "echo  50% |" in shown and len(shown) <= (columns or 80) + 5


@pytest.mark.parametrize("total", [0, 1])
def test_stages_of_no_or_one_step_are_fine(terminal, total):
    bar = Bar(terminal)
    bar("echo", 0, total)
    bar("echo", total, total)
    assert screen(terminal.getvalue()) == ""


def test_notebooks_are_left_to_tqdm(terminal, monkeypatch):
    """tqdm.auto draws a widget in a notebook, where `disable=None` does not ask for a terminal."""
    import tqdm.auto

    made = []
    monkeypatch.setattr(tqdm.auto, "tqdm", lambda **options: made.append(options))
    bar = Bar()
    bar("echo", 0, 10)
    bar("echo", 4, 10)
    assert made[0]["disable"] is None and (made[0]["desc"], made[0]["initial"], made[0]["total"]) == ("echo", 4, 10)


def test_short_stages_do_not_import_tqdm():
    code = (
        "import sys; from sarcl.base.progress import Bar; bar = Bar()\n"
        "for i in range(11): bar('echo', i, 10)\n"
        "sys.exit('tqdm' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
