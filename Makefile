# Needs Python 3.10 to 3.14 with venv, and nothing else: everything goes into .venv, in the versions of the lock.
PYTHON ?= python3
VENV := .venv
BIN = $(VENV)/bin
LOCK := requirements.lock
UV := uv>=0.9,<1

.PHONY: help demo test test-latest coverage docs pictures lock clean
help:
	@echo "make demo   install into $(VENV) and plan both scenes of the paper and measure it again, in short"
	@echo "make test   install into $(VENV) and run every check: ruff, mypy, import-linter, pytest"
	@echo "make test-latest   the same in .venv-latest, with the newest versions instead of those in $(LOCK)"
	@echo "make coverage   run pytest, and again with kernels in plain Python, and list the lines that never ran"
	@echo "make docs   install into $(VENV) and build the pages of docs/ into site/, without a warning"
	@echo "make pictures   run the commands of docs/gallery.md and make its pictures anew"
	@echo "make lock   write the newest versions for Python 3.10 to 3.14 into $(LOCK)"
	@echo "make clean  remove $(VENV), .venv-latest, demo/, site/ and all caches"

demo: $(VENV)/demo.stamp
	$(BIN)/cbrrt demo --output demo

test: $(VENV)/test.stamp
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest -n 2

test-latest:
	rm -rf .venv-latest
	$(MAKE) test VENV=.venv-latest LOCK=

# Lines of compiled kernels are not seen: tests of the kernels run again without the compiler, but for those that would
# take minutes then.
KERNEL_TESTS := control_laws kernel_laws kinematics manoeuvres motion_model motion_check extension nearest \
	replay wheels occupancy report_sections trajectory
TOO_SLOW := thousand or millimetre or TestExtensions or BrakeSafe or brake_safe_tree or position_alone or passes_through
coverage: $(VENV)/test.stamp
	$(BIN)/coverage erase
	$(BIN)/coverage run -m pytest -n 2
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest --hypothesis-profile few -m 'not slow' -k 'not ($(TOO_SLOW))' \
		$(KERNEL_TESTS:%=tests/test_%.py)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

docs: $(VENV)/docs.stamp
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

pictures: $(VENV)/docs.stamp
	$(BIN)/python docs/pictures.py

$(VENV)/demo.stamp: EXTRA :=
$(VENV)/test.stamp: EXTRA := [test]
$(VENV)/docs.stamp: EXTRA := [docs]
# Constraints come as variables and not as --constraint, so that they hold for what builds the package too.
$(VENV)/%.stamp: pyproject.toml Makefile $(LOCK)
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info < (3, 15))' || { \
		echo "error: '$(PYTHON)' is not Python 3.10 to 3.14; name one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "error: '$(PYTHON)' has no venv; on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	PIP_BUILD_CONSTRAINT=$(LOCK) PIP_CONSTRAINT=$(LOCK) \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.$(EXTRA)'
	@touch $@

# One file for all: every version has a marker of the Pythons that it is for.
lock:
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check '$(UV)'
	build/lock/bin/uv pip compile --quiet --upgrade --universal --python-version 3.10 --no-python-downloads \
		--no-annotate --custom-compile-command 'make lock' --extra test --group lock pyproject.toml \
		--output-file $(LOCK)
	rm -rf build

clean:
	rm -rf $(VENV) .venv-latest demo site build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find cbrrt_ompl tests -type d -name __pycache__ -prune -exec rm -rf {} +
