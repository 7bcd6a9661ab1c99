VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed
BUILT  := $(VENV)/.kernels
TOOLS  := $(VENV)/.tools
SOURCES = $(shell find raytrace ao scenes setup.py -name '*.py' 2>/dev/null)
TYPED  := build/typed/obscurance
SUITABLE := import sys, ensurepip, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))
PYTHON ?= $(shell for python in $(BIN)/python python3.14 python3.13 python3.12 python3.11 python3 python; do \
	$$python -c '$(SUITABLE)' >/dev/null 2>&1 && { echo $$python; break; }; done)
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check
PYTEST := $(BIN)/python -m pytest --numprocesses auto --maxprocesses 4

.DEFAULT_GOAL := help
.PHONY: help install wheel blender demo test types test-all lint bench bench-peers peers viewers pictures site clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(STAMP): pyproject.toml
	@python='$(PYTHON)'; "$${python:-none}" -c '$(SUITABLE)' 2>/dev/null || { echo "expected Python 3.11 to 3.14 with its \
	venv module, got $${python:-none}; set PYTHON=/path/to/python" >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; print("Python", sys.version.split()[0], "of", sys.executable, "for $(VENV)")'
	@[ "$$($(BIN)/python -V 2>&1)" = "$$("$(PYTHON)" -V 2>&1)" ] || clear=--clear; "$(PYTHON)" -m venv $$clear $(VENV)
	@$(BIN)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")' \
	>$(VENV)/build.txt
	$(PIP) --requirement $(VENV)/build.txt
	$(BIN)/python setup.py --quiet build_ext --inplace
	$(PIP) --no-build-isolation --editable '.[develop]'
	$(BIN)/python -m compileall -q raytrace ao scenes cli.py
	@touch $@

$(TOOLS): $(STAMP)
	$(PIP) --no-build-isolation --editable '.[test,bench,docs]'
	@touch $@

$(BUILT): $(STAMP) $(SOURCES)
	$(BIN)/python setup.py --quiet build_ext --inplace
	@touch $@

install: $(BUILT) $(TOOLS) ## create .venv, install the project and all its extras into it and build its kernels

wheel: $(STAMP) ## a wheel with the kernels of every level of processors, in dist/
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir dist .

blender: $(STAMP) ## the extension for Blender, in dist/
	@mkdir -p dist
	cd blender && ../$(BIN)/python -m zipfile -c ../dist/obscurance-blender.zip *.py blender_manifest.toml

demo: $(BUILT) ## bake a built-in scene; writes demo/ with a mesh and a picture
	$(BIN)/obscurance demo --output demo

test: install ## lint, types and the default tests
	$(BIN)/ruff check .
	$(MAKE) --no-print-directory types
	$(PYTEST) -m 'not slow'

types: $(TOOLS) ## check the types; the source tree is one package by links in build/
	rm -rf $(TYPED)
	mkdir -p $(TYPED) && ln -sfn $(foreach part,ao raytrace scenes cli.py $(wildcard obscurance/*.py*),../../../$(part)) $(TYPED)
	cd $(TYPED)/.. && $(CURDIR)/$(BIN)/mypy --config-file $(CURDIR)/pyproject.toml -p obscurance

test-all: install ## every test, the slow ones too
	$(PYTEST)

lint: $(TOOLS) ## format and fix what can be fixed
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: install ## the throughput benchmark; writes benchmarks/results/
	$(BIN)/python -m benchmarks.speed.throughput

PEERS := .peers/mitsuba .peers/open3d .peers/blender
.peers/mitsuba: PACKAGE := mitsuba==3.9.1 numpy
.peers/open3d:  PACKAGE := open3d==0.20.0
.peers/blender: PACKAGE := bpy==5.0.1

$(PEERS):
	"$(PYTHON)" -m venv $@
	$@/bin/python -m pip install --quiet --disable-pip-version-check $(PACKAGE) || { rm -rf $@; exit 1; }

peers: ## environments of the other bakers, in .peers/; one that cannot be had is left out
	-@$(MAKE) --no-print-directory --keep-going $(PEERS)

viewers: ## glTF's validator and three.js, in .viewers/, for tests of .glb outputs that are skipped without them
	npm install --no-audit --no-fund --silent --prefix .viewers gltf-validator@2.0.0-dev.3.10 three@0.183.2

bench-peers: install ## bake time against error, ours and the peers'; MESHES=FOLDER adds files, QUICK=1 is for minutes
	$(BIN)/python -m benchmarks.time_against_error $(if $(QUICK),--quick) $(if $(MESHES),--meshes '$(MESHES)')

pictures: install ## the pictures of docs: gallery, temple, the models' spheres, tutorials and, with Chromium, pages
	$(BIN)/python -m benchmarks.pictures.gallery
	$(BIN)/python -m benchmarks.pictures.model_strips
	$(BIN)/python -m benchmarks.pictures.tutorials
	$(BIN)/python -m benchmarks.pictures.half_distances
	$(BIN)/python -m benchmarks.pictures.occluders
	$(BIN)/python -m benchmarks.pictures.high
	$(BIN)/python -m benchmarks.pictures.terrain
	$(BIN)/python -m benchmarks.pictures.elements
	-$(BIN)/python -m benchmarks.pictures.page --pictures docs/viewing

site: $(TOOLS) ## the documentation as a site, in build/site, made without network
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet -d build/doctrees docs build/site

clean: ## remove the environment and everything made
	rm -rf $(VENV) demo build dist raytrace/kernel/*.so *.egg-info .pytest_cache .mypy_cache .ruff_cache
