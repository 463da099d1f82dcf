# make demo | test | bench | clean: everything happens in the virtual environment .venv; nothing else is touched.
# PYTHON=... names another interpreter (3.11 or newer); pip follows your own pip configuration.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet
STAMPS := $(VENV)/stamps
NEW_ENOUGH := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))

.PHONY: help demo test bench clean
.DEFAULT_GOAL := help

help:
	@echo "make demo    Table 2 of Bulgarelli et al. 2011: 10,000 simulations, printed, with file and figures"
	@echo "make test    ruff, mypy, import-linter and pytest"
	@echo "make bench   speed and success, side by side with a scripted loop, CasADi's own C, pink, OMPL and others"
	@echo "make clean   remove the virtual environment and caches (results in runs/ stay)"

demo: $(STAMPS)/core
	@run=table2; \
	if ! $(BIN)/python -c "import sys; from fzcli.loop.compiler import find_compiler; sys.exit(not find_compiler())"; then \
	    run=table2-small; \
	    echo "No C compiler found: running the small table in CasADi's virtual machine instead of the whole one."; \
	fi; \
	$(BIN)/fzcli sweep runs/$$run.yaml && $(BIN)/fzcli plot runs/$$run/$$run.h5

test: $(STAMPS)/test
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m pytest -n 2

bench: $(STAMPS)/bench
	$(BIN)/python benchmarks/run.py

clean:
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache dist
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMPS)/venv:
	@python="$(PYTHON)"; \
	if [ -z "$$python" ]; then \
	    for name in python3 python3.13 python3.12 python3.11; do \
	        if $$name -c "$(NEW_ENOUGH)" 2>/dev/null; then python=$$name; break; fi; \
	    done; \
	fi; \
	if [ -z "$$python" ]; then \
	    echo "fzcli needs Python 3.11 or newer with venv and ensurepip (on Debian: apt install python3-venv);" >&2; \
	    echo "none was found as python3, python3.13, python3.12 or python3.11. Name one: make PYTHON=/path/to/python" >&2; \
	    exit 1; \
	fi; \
	$$python -m venv $(VENV)
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/core: $(STAMPS)/venv pyproject.toml
	$(PIP) --editable .
	@touch $@

$(STAMPS)/test: $(STAMPS)/venv pyproject.toml
	$(PIP) --editable ".[test]"
	@touch $@ $(STAMPS)/core

# pyfuzzylite 8 asks for NumPy 1 but works with NumPy 2, hence without its dependencies
$(STAMPS)/bench: $(STAMPS)/venv pyproject.toml
	$(PIP) --editable ".[bench]"
	$(PIP) --no-deps "pyfuzzylite>=8"
	$(PIP) --editable ".[peers]" || echo "not all peers did install; measuring without them"
	@touch $@ $(STAMPS)/core
