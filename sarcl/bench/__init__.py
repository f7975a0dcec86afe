"""`sarcl bench`: time against ACHIEVED error, on this machine, with peers.

cases       the data, and what the exact sum gives for it
ours        sarcl as a contestant
baseline    NumPy as a contestant
peers       libraries in other environments as contestants, over a pipe
fastsar_peer  what runs in the other environment; imports nothing of sarcl
once        one image in a process of its own: the whole process is timed
measure     contestants take turns
figures     what the rows say: ratios at equal or smaller error, cost against size
backproject the command
table pareto page   figures for the terminal, as a picture, as docs/results.md
"""
