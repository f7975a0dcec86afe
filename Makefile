# The two commands are `make demo` and `make test`. Everything is made inside this folder (.venv, out/);
# see .ci/setup.sh for what is looked for and what is installed.

.DEFAULT_GOAL := help
.PHONY: help demo test test-all fuzz tasks mutants gpu-static bench proof results architecture options site lint clean ready ready-dev

# Tests start hundreds of processes: each would compile the package again where bytecode is not kept.
export PYTHONDONTWRITEBYTECODE :=

ARGS ?=
PYTEST = .venv/bin/python -m pytest --numprocesses auto --maxprocesses 4 --dist loadfile
CODE = sarcl kernels tests bench docs conftest.py

help:  ## this list
	@echo "make GOAL [ARGS='...' handed to the command] [PYTHON=/path/to/python3.12]"
	@sed -n 's/^\([a-z-]*\):[^#]*## */  \1\t/p' Makefile

demo: ready  ## simulate and focus a scene; the picture is out/demo.png
	@.venv/bin/sarcl demo $(ARGS)

test: ready  ## the quick tests, in one process for each processor, at most four
	@$(PYTEST) $(ARGS)

test-all: ready  ## all tests, the slow ones too
	@$(PYTEST) -m '' $(ARGS)

fuzz: ready  ## read 10000 mutated files of every format; SARCL_FUZZ_SEED repeats a run
	@SARCL_FUZZ_CASES=$${SARCL_FUZZ_CASES:-10000} .venv/bin/python -m pytest -m slow tests/io/test_fuzz.py -s $(ARGS)

tasks: ready  ## run 10000 random legal tasks over all verbs; SARCL_TASKS_SEED repeats a run
	@SARCL_TASKS=$${SARCL_TASKS:-10000} .venv/bin/python -m pytest tests/contract/test_legal_tasks.py -k random_legal -s $(ARGS)

mutants: ready  ## make each wrong sign, unit or factor of tests/mutants/mutations.toml: a test must fail
	@.venv/bin/python tests/mutants/run.py $(ARGS)

gpu-static:  ## compile every kernel for GPUs that are not here, and compare with the figures recorded
	@PYTHON='$(PYTHON)' sh .ci/setup.sh gpu-static gpu-static
	@.venv/bin/python tests/gpu_static/run.py $(ARGS)

bench: ready  ## run time of every verb against the error achieved; images beside peers: ARGS='backproject --peer-python PATH'
	@.venv/bin/sarcl bench $(ARGS)

autofocus-trial: ready  ## autofocus on 200 random correct scenes, 200 with errors, 200 arms; bench/results/trials/autofocus.json
	@.venv/bin/python bench/autofocus_trial.py --json bench/results/trials/autofocus.json $(ARGS)

proof: ready  ## measure what docs/guide/proof.md shows, about 40 CPU minutes; then `make results` writes the page
	@rm -f bench/results/trials/contract.json  # a trial continues where its file ends
	@for run in contract_trial.py scaling.py 'faults_trial.py faults' 'faults_trial.py fuzz' 'faults_trial.py mutants' \
	    roofline.py skipping.py; do .venv/bin/python bench/$$run || exit 1; done
	@.venv/bin/python bench/memory.py --series 512 1024 2048 4096 8192 --tolerance 0.1 --max-bytes 1e8 --pulses 512 \
	    --samples 1024 --json bench/results/trials/memory.json

results: ready  ## the pages of results in docs/guide from bench/results/*.json
	@.venv/bin/python bench/report.py

architecture: ready  ## the drawing and the table of docs/developers/architecture.md, from the imports
	@.venv/bin/python docs/developers/draw_architecture.py

options: ready  ## type stubs, page and flags of the verbs' options, from their records
	@.venv/bin/python docs/developers/write_options.py

site:  ## the documentation as a site: out/site/html/index.html; warnings are errors
	@PYTHON='$(PYTHON)' sh .ci/setup.sh site site
	@.venv/bin/python docs/site/build.py

lint: ready-dev  ## style, format, types, and imports that point down
	@status=0; for tool in "ruff check $(CODE)" "ruff format --check $(CODE)" mypy; do \
	    echo "$$tool"; .venv/bin/python -m $$tool || status=1; done; \
	echo lint-imports; .venv/bin/lint-imports --no-logo || status=1; exit $$status

clean:  ## remove .venv and everything made, but not the pictures in out/
	rm -rf .venv build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

ready:
	@PYTHON='$(PYTHON)' sh .ci/setup.sh test '$(or $(MAKECMDGOALS),demo)'

ready-dev:
	@PYTHON='$(PYTHON)' sh .ci/setup.sh dev '$(or $(MAKECMDGOALS),lint)'
