"""fastsar, in an interpreter that has it: reads requests from stdin, answers on stdout, one JSON object per line.

Imports nothing of sarcl. Run by sarcl/bench/_peers.py, or as  python fastsar_peer.py once FOLDER SPEC  to make one
image in a process of its own.

Requests: {"do": "load", "folder": ...}; {"do": "run", "spec": {"former": "exact" or "factorized", "options": {...}}}
makes a former (seconds "setup") and calls the first former made with this spec (seconds "form"; "cpu", CPU seconds
of all processors).

Conventions found in its source (0.1.8), confirmed by the measured errors: samples f_n = fmin + n df of phase
exp(-j 2 pi f tau), referenced to `ref`, the one-way range; pixel [i, j] at (i - nx/2) spx e1 + (j - ny/2) spy e2, so
that e1 is our rows' direction and e2 our columns'; no scale factor, window=False turns the Taylor window off.
"""

import json
import os
import sys
import time


def load(folder):
    """(case, samples, tx, reference ranges) as sarcl/bench/_cases.py saved them."""
    import numpy as np

    def array(name):
        return np.load(os.path.join(folder, name + ".npy"))

    with open(os.path.join(folder, "case.json")) as file:
        return json.load(file), array("samples"), array("tx"), array("reference_range")


def make(data, spec):
    """A former for the data's geometry."""
    import fastsar

    case, samples, tx, reference = data
    kind = {"exact": fastsar.ExactFormer, "factorized": fastsar.ImageFormer}[spec["former"]]
    n, spacing = case["n"], case["spacing"]
    rows, columns = (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)
    geometry = (tx, case["frequency"], case["frequency_step"], samples.shape[1], n, n, spacing, spacing, rows, columns)
    return kind(*geometry, window=False, ref=reference, **spec["options"])


def run(data, formers, spec):
    """Time the making of a former, call the one made first, and pick the checked pixels."""
    start = time.perf_counter()
    made = make(data, spec)
    setup = time.perf_counter() - start
    former = formers.setdefault(json.dumps(spec, sort_keys=True), made)
    start, busy = time.perf_counter(), time.process_time()
    image = former(data[1])
    form, busy = time.perf_counter() - start, time.process_time() - busy
    i, j = data[0]["at"]
    values = [[float(v.real), float(v.imag)] for v in image[i, j]]
    return {"seconds": {"setup": setup, "form": form, "cpu": busy}, "values": values}


def hello():
    """Name and version of the library."""
    try:
        from importlib.metadata import version

        import fastsar  # noqa: F401

        return {"name": "fastsar", "version": version("fastsar"), "python": sys.version.split()[0]}
    except ImportError as exc:
        return {"missing": str(exc)}


def serve():
    """Answer requests until stdin ends; output of the library goes to stderr."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(content):
        answers.write(json.dumps(content) + "\n")
        answers.flush()

    answer(hello())
    formers: dict = {}
    data = None
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if request["do"] == "load":
                formers.clear()
                data = load(request["folder"])
                answer({})
            else:
                answer(run(data, formers, request["spec"]))
        except Exception as exc:  # a setting that fails is one row of the table
            answer({"error": f"{type(exc).__name__}: {exc}"})


if __name__ == "__main__":
    if sys.argv[1:2] == ["once"]:
        saved = load(sys.argv[2])
        make(saved, json.loads(sys.argv[3]))(saved[1])
    else:
        serve()
