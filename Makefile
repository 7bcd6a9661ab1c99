PYTHON ?= python3.11
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install demo test test-all lint bench model-strips gallery clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(STAMP): pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) not found; set PYTHON=/path/to/python" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test,bench]'
	@touch $@

install: $(STAMP) ## create .venv and install the project into it

demo: $(STAMP) ## bake a built-in scene; writes demo/ with a mesh and a picture
	$(BIN)/obscurance demo --output demo

test: $(STAMP) ## lint, types and the default tests
	$(BIN)/ruff check .
	$(BIN)/mypy raytrace ao scenes cli.py
	$(BIN)/python -m pytest -m 'not slow'

test-all: $(STAMP) ## every test, the slow ones too
	$(BIN)/python -m pytest

lint: $(STAMP) ## format and fix what can be fixed
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(STAMP) ## the throughput benchmark; writes benchmarks/results/
	$(BIN)/python -m benchmarks.throughput

model-strips: $(STAMP) ## the sphere pictures of docs/models
	$(BIN)/python -m benchmarks.model_strips

gallery: $(STAMP) ## the pictures of docs/gallery
	$(BIN)/python -m benchmarks.gallery

clean: ## remove the environment and everything made
	rm -rf $(VENV) demo build *.egg-info .pytest_cache .mypy_cache .ruff_cache
