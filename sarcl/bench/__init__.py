"""`sarcl bench`: run time against achieved error, on this machine, with peers.

For other folders:

    backproject     the command
    once            one image in a process of its own: python -m sarcl.bench.once
    fastsar_peer    runs in another environment, and imports nothing of sarcl
    channels_page   tables of bench/channels.py
    echo_page       tables of bench/echo.py
    page            docs/guide/results.md and the README's table
    pareto          rate against achieved error, as a picture

For this folder alone:

    _baseline       backprojection written in NumPy
    _cases          data of the benchmark
    _contestant     a program that takes part, and a run of it
    _exact          the exact sum at some pixels
    _figures        rates, ratios at equal or smaller error, cost against size
    _measure        runs and times the contestants, which take turns
    _ours           sarcl as a contestant
    _peers          libraries in another environment, over a pipe
    _quiet          waits until other programs leave the processors alone
    _table          figures as tables
"""

__all__ = ["backproject", "channels_page", "echo_page", "fastsar_peer", "once", "page", "pareto"]
