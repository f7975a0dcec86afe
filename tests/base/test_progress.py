"""The progress bar: drawn on terminals only, for what lasts, and never in the way."""

import io

import pytest

from sarcl.base.progress import Bar, line, rate_text, time_text


@pytest.fixture(autouse=True)
def a_terminal_that_can_erase_a_line(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


def work(bar, clock, seconds, steps=100, stage="backproject"):
    bar(stage, 0, steps)
    for done in range(1, steps + 1):
        clock.now += seconds / steps
        bar(stage, done, steps)


def screen(text):
    """What a terminal's last line shows after `text`."""
    for part in text.split("\r"):
        shown = part.replace("\x1b[K", "")
    return shown


def test_a_stage_shorter_than_a_second_draws_nothing(clock):
    out = Terminal()
    work(Bar(out, clock), clock, 0.9)
    assert out.getvalue() == ""


def test_a_longer_stage_shows_part_rate_and_time_left(clock):
    out = Terminal()
    bar = Bar(out, clock)
    bar("backproject", 0, 1000)
    clock.now = 2.0
    bar("backproject", 500, 1000)
    shown = screen(out.getvalue())
    assert shown.startswith("backproject  ############------------  50%")
    assert "250/s" in shown and "2 s left" in shown


def test_the_line_is_empty_when_a_stage_has_ended(clock):
    out = Terminal()
    work(Bar(out, clock), clock, 5)
    assert out.getvalue() and screen(out.getvalue()) == ""


def test_a_stage_that_never_ends_is_wiped_when_the_next_begins(clock):
    out = Terminal()
    bar = Bar(out, clock)
    bar("profiles", 0, 10)
    clock.now = 3.0
    bar("profiles", 5, 10)
    bar("backproject", 0, 10)
    assert screen(out.getvalue()) == ""


def test_ctrl_c_leaves_the_line_empty(clock):
    out = Terminal()
    with pytest.raises(KeyboardInterrupt), Bar(out, clock) as bar:
        bar("echo", 0, 10)
        clock.now = 3.0
        bar("echo", 5, 10)
        assert screen(out.getvalue()) != ""
        raise KeyboardInterrupt
    assert screen(out.getvalue()) == ""


def test_nothing_is_drawn_where_stderr_is_no_terminal(clock):
    out = io.StringIO()
    work(Bar(out, clock), clock, 5)
    assert out.getvalue() == ""


def test_it_draws_at_most_ten_times_a_second(clock):
    out = Terminal()
    work(Bar(out, clock), clock, 5, steps=10_000)
    assert 30 <= out.getvalue().count("left") <= 41


def test_a_lost_terminal_costs_no_result(clock):
    class Lost(Terminal):
        def write(self, text):
            raise OSError("gone")

    work(Bar(Lost(), clock), clock, 5)
    closed = Terminal()
    closed.close()
    work(Bar(closed, clock), clock, 5)


@pytest.mark.parametrize("total", [0, 1])
def test_stages_of_no_or_one_step_are_fine(clock, total):
    bar = Bar(Terminal(), clock)
    bar("echo", 0, total)
    clock.now = 9.0
    bar("echo", total, total)


def test_time_left_is_what_the_rate_so_far_says():
    assert line("echo", 1, 4, 10.0).endswith("30 s left")


@pytest.mark.parametrize(
    ("rate", "text"),
    [
        (0.1, "6/min"),
        (0.5, "0.5/s"),
        (850, "850/s"),
        (999.9, "1 k/s"),
        (1234, "1.23 k/s"),
        (5.5e6, "5.5 M/s"),
        (2e9, "2 G/s"),
    ],
)
def test_rates_are_in_units_a_person_reads(rate, text):
    assert rate_text(rate) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0 s"), (59.4, "59 s"), (59.6, "1 min 00 s"), (200, "3 min 20 s"), (7500, "2 h 05 min")],
)
def test_durations_are_in_units_a_person_reads(seconds, text):
    assert time_text(seconds) == text
