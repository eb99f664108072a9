# Everything a fresh machine needs: Python 3.11 and make. `make help` lists the commands.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
OLDEST := .venv-oldest
DOCS := .venv-docs
RUN := $(VENV)/bin/python
PLATFORM ?=
SEGMENTS ?= 6
BLENDERS ?= window
# Tests run side by side, file by file, with one thread each. A process that crashes ends the run.
JOBS ?= 2
THREADS := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
PYTEST := pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --max-worker-restart 0
# What depends on the version of Blender, and a little of the core for its NumPy; the rest has been tested on the newest.
ON_OLDEST := tests/blender tests/core/test_estimator.py tests/core/test_model_file.py \
	tests/core/spectral/test_signature.py tests/core/learning/test_gaussian_mixture.py \
	$(addprefix --ignore tests/blender/,parts workflow/test_sides.py workflow/test_guard.py workflow/test_model_ranking.py \
	test_installed_zip.py cli/test_recipes.py cli/test_command_batch.py)
# Wheels only, and no byte code before it is needed.
PIP := -m pip install --quiet --disable-pip-version-check --only-binary :all: --no-compile

.PHONY: help install install-oldest demo test test-oldest test-window guard screenshots fuzz lint zip repository docs clean

help:  ## list the commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 16

demo: $(VENV)/.ready  ## build a creature, learn its parts, check them on unseen poses (INPUT=file.glb: your own)
	$(RUN) -m wks_segment demo --segments $(SEGMENTS) $(if $(INPUT),--input "$(INPUT)")

install: $(VENV)/.ready

install-oldest: $(OLDEST)/.ready

test: $(VENV)/.ready  ## all tests, two side by side (JOBS=4: four)
	$(THREADS) $(RUN) -m $(PYTEST)

test-oldest: $(OLDEST)/.ready  ## on the oldest Blender that is supported, what depends on it or on its NumPy
	$(THREADS) $(OLDEST)/bin/python -m $(PYTEST) $(ON_OLDEST)

test-window: $(VENV)/.ready  ## a real Blender 5.2 and 4.3, with mouse and keyboard (root; 4.4 GB in BLENDERS=window)
	WKS_SEGMENT_WINDOW="$(abspath $(BLENDERS))" $(RUN) -m pytest tests/window

guard: $(VENV)/.ready  ## fails if a stage of a small job has more to do than before (counts, not seconds)
	$(THREADS) $(RUN) -m benchmarks.guard

screenshots: $(VENV)/.ready  ## the pictures of the docs that show the window, from a real Blender
	WKS_SEGMENT_WINDOW="$(abspath $(BLENDERS))" $(RUN) -m scripts.screenshots

fuzz: $(VENV)/.ready  ## thousands of broken meshes and model files, with counts (takes ten minutes)
	$(THREADS) $(RUN) -m $(PYTEST) tests -k "any_" --hypothesis-profile fuzz --timeout 7200

lint: $(VENV)/.ready  ## ruff, mypy, and the spelling of code and docs
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(VENV)/bin/codespell
	$(RUN) -m mypy

zip: $(VENV)/.ready  ## the extension for each platform, in dist/ (PLATFORM=linux-x64: for one)
	$(RUN) scripts/build_zip.py $(if $(PLATFORM),--platform $(PLATFORM))

repository: $(VENV)/.ready  ## a folder for a web server, from which Blender installs and updates, in repository/
	$(RUN) -m scripts.build_repository

docs: $(DOCS)/.ready  ## the site of docs/, in site/; fails on a dead link
	$(DOCS)/bin/python -m mkdocs build --strict

clean:  ## remove the environments and all that was built
	rm -rf $(VENV) $(OLDEST) $(DOCS) dist wheels demo site repository

$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
		{ echo "Python 3.11 is needed (bpy has no wheel for others): make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(RUN) $(PIP) --editable ".[dev]"
	touch $@

$(OLDEST)/.ready: pyproject.toml
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python $(PIP) --editable ".[oldest]"
	touch $@

$(DOCS)/.ready: pyproject.toml
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python $(PIP) --editable ".[docs]"
	touch $@
