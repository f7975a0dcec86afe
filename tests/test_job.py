"""Ctrl-C reaches a command even where Python would drop it."""

import os
import signal
import threading

import pytest

from sarcl.job import Job


@pytest.fixture(autouse=True)
def python_handles_ctrl_c():
    """Also where pytest was started with Ctrl-C ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Closing:
    """Ctrl-C while this is destroyed."""

    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_raises_at_once():
    with pytest.raises(KeyboardInterrupt), Job([]):
        os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("it went on")


def test_ctrl_c_in_a_destructor_raises_at_the_next_report_of_progress(capsys):
    with pytest.raises(KeyboardInterrupt), Job([]) as job:
        Closing()
        job.progress("backproject", 1, 2)
        raise AssertionError("it went on")
    assert capsys.readouterr().err == ""


def test_ctrl_c_in_a_destructor_stops_before_the_next_line(capsys):
    with pytest.raises(KeyboardInterrupt), Job([]) as job:
        Closing()
        job.say("wrote it")
    assert capsys.readouterr().out == ""


def test_the_signal_belongs_to_the_caller_again_afterwards():
    with Job([]):
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_command_run_from_a_thread_works():
    lines = []

    def run():
        with Job([]) as job:
            job.progress("echo", 0, 1)
            lines.append("done")

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert lines == ["done"]


def test_finished_files_are_remembered():
    kept = []
    with Job(kept) as job:
        job.finished("a.png")
    assert kept == ["a.png"]
