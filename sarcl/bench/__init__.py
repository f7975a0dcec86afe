"""`sarcl bench`: run time against achieved error, on this machine, with peers.

For other folders:

    backproject    images, beside peers
    baseline       backprojection written in NumPy
    documents      documents of measurements: machine, devices and rows
    exact          the exact sum at some pixels
    fastsar_peer   runs in another environment, and imports nothing of sarcl
    one_shot       one image in a process of its own: python -m sarcl.bench.one_shot
    pareto         plot of rate against achieved error; needs the extra `plots`
    ratios         rates, ratios at equal or smaller error, cost against size
    spaceborne     pulses and pixels of the public GPU benchmark
    tables         measurements as tables
    verb_pictures  run time of a verb against achieved error, and against size
    verbs          every verb, on tasks of its own

For this folder alone:

    _cases         data of the benchmark
    _competitor    a program that is measured, and one run of it
    _measure       runs and times the competitors in turns
    _peers         libraries in another environment, through a pipe
    _run_sarcl     sarcl as a competitor
    _verb_cases    a task of every verb, of any size
"""
