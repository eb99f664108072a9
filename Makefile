# Everything a fresh machine needs: Python 3.11 and make. `make help` lists the commands.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
OLDEST := .venv-oldest
DOCS := .venv-docs
RUN := $(VENV)/bin/python
PLATFORM ?=
SEGMENTS ?= 6
BLENDERS ?= window

.PHONY: help demo test test-oldest test-window screenshots fuzz lint zip docs clean

help:  ## list the commands
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 16

demo: $(VENV)/.ready  ## build a creature, learn its parts, check them on unseen poses (INPUT=file.glb: your own)
	$(RUN) -m wks_segment demo --segments $(SEGMENTS) $(if $(INPUT),--input "$(INPUT)")

test: $(VENV)/.ready  ## all tests
	$(RUN) -m pytest

test-oldest: $(OLDEST)/.ready  ## all tests on the oldest Blender that is supported
	$(OLDEST)/bin/python -m pytest

test-window: $(VENV)/.ready  ## a real Blender 5.2 and 4.3, with mouse and keyboard (root; 4.4 GB in BLENDERS=window)
	WKS_SEGMENT_WINDOW="$(abspath $(BLENDERS))" $(RUN) -m pytest tests/window

screenshots: $(VENV)/.ready  ## the pictures of the docs that show the window, from a real Blender
	WKS_SEGMENT_WINDOW="$(abspath $(BLENDERS))" $(RUN) -m scripts.screenshots

fuzz: $(VENV)/.ready  ## thousands of broken meshes and model files, with counts (takes ten minutes)
	$(RUN) -m pytest tests -k "any_" --hypothesis-profile fuzz --timeout 7200

lint: $(VENV)/.ready  ## ruff and mypy
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

zip: $(VENV)/.ready  ## the extension for each platform, in dist/ (PLATFORM=linux-x64: for one)
	$(RUN) scripts/build_zip.py $(if $(PLATFORM),--platform $(PLATFORM))

docs: $(DOCS)/.ready  ## the site of docs/, in site/; fails on a dead link
	$(DOCS)/bin/python -m mkdocs build --strict

clean:  ## remove the environments and all that was built
	rm -rf $(VENV) $(OLDEST) $(DOCS) dist wheels demo site

$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || \
		{ echo "Python 3.11 is needed (bpy has no wheel for others): make PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --disable-pip-version-check --editable ".[dev]"
	touch $@

$(OLDEST)/.ready: pyproject.toml
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[oldest]"
	touch $@

$(DOCS)/.ready: pyproject.toml
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check --editable ".[docs]"
	touch $@
