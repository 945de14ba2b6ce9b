# Needs Python 3.10, 3.11 or 3.12 with venv, and nothing else: everything goes into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: help demo test coverage docs clean
help:
	@echo "make demo   install into $(VENV) and plan both scenes of the paper and measure it again, in short"
	@echo "make test   install into $(VENV) and run every check: ruff, mypy, import-linter, pytest"
	@echo "make coverage   run pytest, and again with kernels in plain Python, and list the lines that never ran"
	@echo "make docs   install into $(VENV) and build the pages of docs/ into site/, without a warning"
	@echo "make clean  remove $(VENV), demo/, site/ and all caches"

demo: $(VENV)/demo.stamp
	$(BIN)/cbrrt demo --output demo

test: $(VENV)/test.stamp
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest -n 2

# Lines of compiled kernels are not seen: tests of the kernels run again without the compiler, but for those that would
# take minutes then.
KERNEL_TESTS := control_laws kernel_laws kinematics manoeuvres disc_tree motion_model motion_check extension nearest \
	replay wheels occupancy report_sections trajectory
TOO_SLOW := thousand or millimetre or MapHolds or BrakeSafe or brake_safe_tree or position_alone or passes_through
coverage: $(VENV)/test.stamp
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -n 2
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest --hypothesis-profile few -m 'not slow' -k 'not ($(TOO_SLOW))' \
		$(KERNEL_TESTS:%=tests/test_%.py)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

docs: $(VENV)/docs.stamp
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

$(VENV)/demo.stamp: EXTRA :=
$(VENV)/test.stamp: EXTRA := [test]
$(VENV)/docs.stamp: EXTRA := [docs]
$(VENV)/%.stamp: pyproject.toml Makefile
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 13))' || { \
		echo "error: '$(PYTHON)' is not Python 3.10, 3.11 or 3.12; name one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "error: '$(PYTHON)' has no venv; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.$(EXTRA)'
	@touch $@

clean:
	rm -rf $(VENV) demo site build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find cbrrt_ompl tests -type d -name __pycache__ -prune -exec rm -rf {} +
