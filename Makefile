# Every target works from a clean checkout with Python >= 3.11, venv and pip.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: help check test lint order deep fuzz kills mutants machines coverage report quick reference request kinds ladders picture docs site bench clean drawn paper

help: ## show this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(VENV)/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install -q -c constraints.txt -e '.[dev]'
	touch $@

check: ## the gate: the README's test command, lint and types, in a fresh clone and environment
	bash .ci/run

test: $(VENV)/ready ## the tests, in this checkout
	$(BIN)/pytest -n 2

lint: $(VENV)/ready ## format, lint, types, the prose of README and docs, and the files for the forge, in this checkout
	$(BIN)/ruff format . && $(BIN)/ruff check . && $(BIN)/mypy && $(BIN)/python -m tests.prose && .ci/forge

order: $(VENV)/ready ## the tests in a random order; it prints the seed (make order SEED=2 repeats one)
	$(BIN)/pytest -n 2 -p randomly $(and $(filter command line,$(origin SEED)),--randomly-seed=$(SEED))

deep: $(VENV)/ready ## the slow tests too, with many more random cases
	HYPOTHESIS_PROFILE=deep $(BIN)/pytest -n 2 -m "slow or not slow"

fuzz: $(VENV)/ready ## mutated scenes, runs and command lines against both packages
	$(BIN)/python -m tests.fuzz scene_file --count 20000
	$(BIN)/python -m tests.fuzz scene_data --count 20000
	$(BIN)/python -m tests.fuzz simulation --count 2000
	$(BIN)/python -m tests.fuzz command_line --count 1000

kills: $(VENV)/ready ## processes of studies and ensembles killed at random moments: is a record lost?
	$(BIN)/python -m tests.kills

SEED := 1

mutants: $(VENV)/ready ## plant 50 random defects (make mutants SEED=2) and print which the tests see
	$(BIN)/python -m tests.mutants --seed $(SEED) --count 50

machines: $(VENV)/ready ## the tests as on other processors: OpenBLAS' and numba's code for them, and motions compared
	$(BIN)/python -m tests.machines --motions
	$(BIN)/python -m tests.machines

coverage: $(VENV)/ready ## coverage of mbref, its kernels run as plain Python
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run --source=mbref -m pytest -q tests/properties \
	    tests/contracts/test_formulations.py tests/doors/statics/test_counts.py tests/doors/files/test_scene.py
	$(BIN)/coverage report

report: $(VENV)/ready ## the whole comparison report, into report/
	$(BIN)/crosscheck report --depth whole

quick: $(VENV)/ready ## a comparison report in about three minutes, into report/
	$(BIN)/crosscheck report --quick

PROBES := --scene "dead end" --scene "tumbling body" --scene "heavy top" --scene "universal joint" --scene "cylindrical driver" --scene door \
    --scene "floating pair" --scene "two drivers" --scene "two torsion springs" --scene "drawn loop"

VERIFIED = $$($(BIN)/python -c "from crosscheck.engine import default_engines as names; print(*names())")

REFERENCE := reports/reference
ANEW := build/reference
KEEP = $(BIN)/python -m reports.keep
UNPACKED = rm -rf build/kept && $(BIN)/python -m zipfile -e $(REFERENCE)/records.zip build/kept
PACKED = $(KEEP) build/kept $(REFERENCE) && $(BIN)/crosscheck report --render $(REFERENCE)
ON_REQUEST := dart drake mjx bullet warp newton
PROBES_drake := $(PROBES)
PROBES_dart := # all mechanisms of the suite
PROBES_warp :=
PROBES_mjx := $(PROBES) --scene planar_slider_crank # a fast loop, on which MJX is wrong
PROBES_bullet := $(PROBES)
PROBES_newton := $(PROBES)
KEPT = build/kept/conformance/*_*.json $(ON_REQUEST:%=build/kept/conformance/%.json)

reference: $(VENV)/ready ## the committed report with its records, anew, into reports/reference/
	rm -rf $(ANEW) && $(BIN)/crosscheck report --quick --out $(ANEW)
	$(UNPACKED) && mkdir $(ANEW)/conformance && cp $(KEPT) $(ANEW)/conformance
	for engine in $(VERIFIED); do $(BIN)/crosscheck verify $$engine --in-process --json \
	    $(PROBES) > $(ANEW)/conformance/$$engine.json; done
	rm -rf $(REFERENCE) && $(KEEP) $(ANEW) $(REFERENCE)
	$(BIN)/crosscheck report --render $(REFERENCE)

request: $(VENV)/ready ## every check on engines that run on request, if installed, for the committed report
	$(UNPACKED)
	-$(foreach engine,$(ON_REQUEST),$(BIN)/crosscheck verify $(engine) --in-process --json \
	    $(PROBES_$(engine)) > build/kept/conformance/$(engine).json;)
	$(PACKED)

DRAWN := mechanisms 200 --beside mbref=taylor

drawn: $(VENV)/ready ## every check on random mechanisms, for the committed report; resumes from build/drawn/
	mkdir -p build/drawn && $(UNPACKED)
	for engine in mujoco pinocchio exudyn; do $(BIN)/crosscheck verify $$engine --$(DRAWN) --json \
	    --records build/drawn/$$engine.jsonl > build/kept/conformance/$${engine}_drawn.json; done
	$(BIN)/crosscheck verify mbref --family taylor --mechanisms 2000 --json \
	    --records build/drawn/mbref.jsonl > build/kept/conformance/mbref_drawn.json
	$(PACKED)

PAPER := reports/paper

paper: $(VENV)/ready ## the committed page on the paper with its records, anew, into reports/paper/
	rm -rf build/paper && $(BIN)/crosscheck paper --out build/paper
	rm -rf $(PAPER) && $(KEEP) build/paper $(PAPER)
	$(BIN)/crosscheck report --section paper --render $(PAPER)

KINDS := bennett 'slider_crank_chain[4]' planar_slider_crank_equal flyball_governor

kinds: $(VENV)/ready ## the page on choosing an engine, with its records, anew, into docs/ and reports/kinds/
	rm -rf build/kinds && $(BIN)/crosscheck report --quick $(KINDS) --out build/kinds
	$(KEEP) --beside build/kinds reports/kinds
	$(BIN)/python -m reports.pages which-engine

LADDERS := build/stability

ladders: $(VENV)/ready ## mbref's methods on mechanisms that become difficult, with records, anew, into reports/stability/
	$(BIN)/crosscheck report --section stability --engine mbref --out $(LADDERS)
	$(KEEP) --without-motions $(LADDERS) reports/stability
	$(BIN)/crosscheck report --section stability --render reports/stability

picture: $(VENV)/ready ## the README's moving picture, into reports/rendered/
	$(BIN)/python -m reports --force --picture reports/rendered/passage.svg

docs: $(VENV)/ready ## every page, schema and report that is made from code and committed records
	mkdir -p build && $(BIN)/mbref schema > build/scene.schema.json && mv build/scene.schema.json mbref/templates/
	$(BIN)/python docs/method_pages.py
	$(BIN)/python -m tests.zoo.table docs/results/conformance.md
	$(BIN)/python -m reports.pages
	$(BIN)/crosscheck report --render reports/reference
	$(BIN)/crosscheck report --section stability --render reports/stability
	$(BIN)/crosscheck report --section paper --render $(PAPER)

site: $(VENV)/ready ## the documentation as a site, into build/site/, its commands run, its links checked
	$(BIN)/pip install -q -c constraints.txt -e '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

bench: $(VENV)/ready ## the benchmarks, printed
	for script in $$(grep -l __main__ benchmarks/*.py); do $(BIN)/python $$script; done

clean: ## remove what the targets above made
	rm -rf $(VENV) report build *.egg-info .pytest_cache .hypothesis .ruff_cache .mypy_cache
