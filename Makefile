# One word for each thing one does with roadprint, the same for people, CI and the container.
# Every target makes what it needs first: Python 3.11 and make are enough.

VENV ?= .venv
EXTRAS ?= dev
DATA ?= demo-data
PORT ?= 8000
MEASUREMENTS ?= ../shared/data
BIN := $(VENV)/bin
ARGS ?=

.DEFAULT_GOAL := help
.PHONY: help install system demo serve test lint format types contracts bench evaluate evaluation openapi docs constraints check clean

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

install: ## .venv with roadprint and everything that its tests use, versions locked
	@bash .ci/setup venv "$(VENV)" "$(EXTRAS)"

system: ## Debian packages that the tests use (as root; elsewhere those tests are skipped)
	@bash .ci/setup system

demo: install ## simulate the paper's area, survey it, build the map, locate 200 windows
	$(BIN)/roadprint demo --data $(DATA) $(ARGS)

serve: install ## serve the map that the demo left
	$(BIN)/roadprint serve --data $(DATA) --port $(PORT) $(ARGS)

test: install system ## every test
	$(BIN)/pytest $(ARGS)

lint: install ## style of the code, and of the Dockerfile
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/hadolint Dockerfile

format: install ## mend what the linter can mend
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: install ## mypy --strict
	$(BIN)/mypy

contracts: install ## which room may import which
	$(BIN)/lint-imports

bench: install ## what each thing costs, beside its floor
	@for each in benchmarks/bench_*.py; do \
		$(BIN)/python -m "benchmarks.$$(basename "$$each" .py)" $(ARGS) || exit 1; \
	done

evaluate: install ## a short run of the laboratory: every method on the paper's area, into results/short
	$(BIN)/roadprint evaluate --scenario paper --experiments cells,cdf,reliability --seeds 1 --windows 60 --out results/short $(ARGS)

evaluation: install ## the whole laboratory (a quarter of an hour and more), then docs/evaluation.md from its results
	$(BIN)/roadprint evaluate --scenario paper --experiments all --seeds 3 --windows 300 --out results/paper $(ARGS)
	@runs="paper=results/paper"; \
	for pair in streets:santa_monica_att route:pcat; do \
		run="$${pair%%:*}"; data="$(MEASUREMENTS)/$${pair#*:}"; \
		if [ ! -d "$$data" ]; then echo "no measurements at $$data: its part of the page stays as it is"; continue; fi; \
		$(BIN)/roadprint evaluate --data "$$data" --seeds 1 --windows 300 --out "results/$$run" $(ARGS) || exit 1; \
		runs="$$runs $$run=results/$$run"; \
	done; $(BIN)/python docs/refresh_evaluation.py $$runs

openapi: install ## openapi/openapi.json from the code
	$(BIN)/roadprint openapi --out openapi/openapi.json

docs: install openapi ## the generated part of the documentation, and the tests that hold it to the code
	$(BIN)/pytest -q tests/architecture

check: lint types contracts test ## all that must pass before a change lands

constraints: install ## constraints.txt anew, from what is installed now
	@{ sed -n '/^#/p' constraints.txt; $(BIN)/pip freeze --exclude-editable | sort -fu; } > constraints.new
	@mv constraints.new constraints.txt

clean: ## all that was made here, the environment and the demo's data included
	rm -rf $(VENV) demo-data results build *.egg-info app/numerics/_native*.so .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
