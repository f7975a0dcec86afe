"""Ctrl-C ends a command even where Python drops the KeyboardInterrupt."""

import os
import signal
import threading

import pytest

from sarcl.cli._job import Job, complete
from sarcl.cli.parser import main
from sarcl.io import output_paths


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
    with pytest.raises(KeyboardInterrupt), Job({}):
        os.kill(os.getpid(), signal.SIGINT)
        raise AssertionError("it went on")


def test_ctrl_c_in_a_destructor_raises_at_the_next_report_of_progress(capsys):
    with pytest.raises(KeyboardInterrupt), Job({}) as job:
        Closing()
        job.progress("backproject", 1, 2)
        raise AssertionError("it went on")
    assert capsys.readouterr().err == ""


def test_ctrl_c_in_a_destructor_stops_before_the_next_line(capsys):
    with pytest.raises(KeyboardInterrupt), Job({}) as job:
        Closing()
        job.say("wrote it")
    assert capsys.readouterr().out == ""


def test_ctrl_c_does_not_cut_the_beginning_of_a_file_in_two(tmp_path, monkeypatch):
    unlink = type(tmp_path).unlink

    def interrupted(path, **options):
        os.kill(os.getpid(), signal.SIGINT)
        unlink(path, **options)

    with pytest.raises(KeyboardInterrupt), Job({}) as job:
        monkeypatch.setattr(type(tmp_path), "unlink", interrupted)
        output_paths.check_writable(tmp_path / "a.png")
        job.progress("echo", 0, 1)
    assert not list(tmp_path.iterdir())


def test_an_error_that_ctrl_c_caused_counts_as_ctrl_c():
    with pytest.raises(KeyboardInterrupt), Job({}):
        Closing()
        raise TypeError("a C library met an exception it did not expect")


def test_the_signal_belongs_to_the_caller_again_afterwards():
    with Job({}):
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_command_run_from_a_thread_works():
    lines = []

    def run():
        with Job({}) as job:
            job.progress("echo", 0, 1)
            lines.append("done")

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert lines == ["done"]


def test_a_file_that_has_taken_its_place_is_complete_and_one_that_was_there_before_is_not(tmp_path):
    old, new, missing = (tmp_path / name for name in ("old", "new", "missing"))
    old.write_text("as it was")
    new.write_text("as it was")
    outputs = {}
    with Job(outputs) as job:
        for path in (old, new, missing):
            job.expect(path)
        with output_paths.atomic(new) as part:
            part.write_text("whole")
    assert complete(outputs) == [str(new)]


def test_sigterm_ends_a_command_as_ctrl_c_does_with_a_status_of_its_own(monkeypatch, capsys):
    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with pytest.raises(KeyboardInterrupt) as caught, Job({}):
            os.kill(os.getpid(), signal.SIGTERM)
            raise AssertionError("it went on")
        assert caught.value.args == (signal.SIGTERM,)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
        monkeypatch.setattr("sarcl.cli._commands.devices", lambda args, job: os.kill(os.getpid(), signal.SIGTERM))
        assert main(["devices"]) == 143
        assert "ended by SIGTERM; nothing was written" in capsys.readouterr().err
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_program_that_handles_sigterm_itself_keeps_its_handler():
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        with Job({}):
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
