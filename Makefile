# `make demo` and `make test` are the two commands; the rest serves them. Everything lives in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/pip --disable-pip-version-check --quiet
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-emit-index-url \
	--no-emit-find-links --custom-compile-command "make lock"

.PHONY: help demo cell install quick test test-all test-night test-busy test-opencv4 test-deployed test-systemd test-fleet check bench torture lock sbom deb release docs format clean page-vendor

help:
	@echo "make demo     install, then calibrate and register against the mock cell, and print the truth beside it"
	@echo "make cell     the same cell and daemon, left running in the foreground, with their page in the browser"
	@echo "make install  install only: the command is then $(BIN)/handeyed"
	@echo "make quick    the tests, without the slow ones, that reach what changed since they last ran; the first time all of them"
	@echo "make test     the tests, without the slow ones"
	@echo "make test-all every test that needs nothing but the repository; .ci/run runs these"
	@echo "make test-busy  the same while every core is kept busy: what fails then depends on the clock"
	@echo "make test-opencv4  the tests of what calls OpenCV, and the comparison with OpenCV's calibrateHandEye, under OpenCV 4.14"
	@echo "make test-deployed  what deployment depends on, with the Python and the libraries that are deployed, and the demo"
	@echo "make test-systemd  the package under a live systemd, in a container: the story of docs/runbook.md, as root"
	@echo "make test-fleet  20 mock cells and daemons, an OPC UA gateway, Prometheus and S3 on this machine; CELLS= chooses how many"
	@echo "make check    subjects and bodies of commits, formatting, lint, types, import contracts"
	@echo "make bench    measure for half an hour, and write docs/benchmarks.md"
	@echo "make docs     build the documentation into daemon/site, which the daemon serves under /docs/, and check its links"
	@echo "make deb      build the Debian package into dist/"
	@echo "make release  package, wheel, wheelhouse, SBOM, checksums and a folder for apt, in dist/releases; KEY= signs them"
	@echo "make torture  kill -9 at random and at every failpoint, 1000 times, and 2000 histories of everything that can happen"
	@echo "              at a cell, in any order (ROUNDS=200 HISTORIES=100 for fewer)"
	@echo "make sbom     what the daemon is made of: CycloneDX, in build/sbom.cdx.json"
	@echo "make page-vendor  build the libraries of the operator's page anew (npm); they are committed"
	@echo "make lock     pin the dependencies for deployment (deploy/*.lock)"

demo: install
	@$(BIN)/handeyed demo

cell: install
	@$(BIN)/handeyed demo --keep --open

install: $(VENV)/installed

$(VENV)/installed: pyproject.toml
	@echo "Installing into $(VENV) (once; a minute or two) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) install --editable .
	@touch $@

$(VENV)/developing: $(VENV)/installed
	@echo "Installing the development tools ..."
	@$(PIP) install --upgrade "pip>=25.1" # Debian 12's pip knows no dependency groups
	@$(PIP) install --group dev
	@touch $@

# Each of the many processes would compile every module anew.
unexport PYTHONDONTWRITEBYTECODE

# Small matrices get one thread each, as from the command line. Many tests wait for a socket: two tests a core.
quick test test-all test-busy test-opencv4: export OPENBLAS_NUM_THREADS ?= 1
TEST_WORKERS ?= $(shell expr 2 \* $$(nproc))

# What each test executed is kept beside the environment. Child processes, the page, RAPID and JSON are not seen: the
# whole runs find what this one misses. Without --testmon-forceselect, -m would select every test again.
quick: $(VENV)/developing
	TESTMON_DATAFILE=$(VENV)/testmondata $(BIN)/pytest --testmon --testmon-forceselect -n 2 -m "not slow" -q || [ $$? = 5 ] # none

test: $(VENV)/developing
	$(BIN)/pytest -n $(TEST_WORKERS) --dist worksteal -m "not slow"

test-all: $(VENV)/developing
	$(BIN)/pytest -n $(TEST_WORKERS) --dist worksteal --durations=60

# The statistics whole, of which every commit tries a third.
test-night: $(VENV)/developing
	HANDEYED_NIGHT=1 $(BIN)/pytest -n $(TEST_WORKERS) --dist worksteal

test-busy: $(VENV)/developing
	$(BIN)/python -m tests.support.busy $(BIN)/pytest -n $(TEST_WORKERS) --dist worksteal

# OpenCV 5 has no calibrateHandEye. The tests are those of what calls OpenCV; OPENCV4_TESTS= and OPENCV4_CELLS= choose
# less, or more; OPENCV4_MARKS="not slow" leaves out what takes long.
OPENCV4 := .venv-opencv4
OPENCV4_TESTS ?= $(addprefix tests/,calibration/detection calibration/observations calibration/preprocessing \
	calibration/closed_forms calibration/test_solve.py calibration/test_targets.py registration/points registration/profiles \
	drivers/cameras mock_robot/scene daemon/cli/test_target.py)
OPENCV4_CELLS ?= 8

test-opencv4: $(OPENCV4)/installed
	$(OPENCV4)/bin/python -m pytest -n auto $(if $(OPENCV4_MARKS),-m "$(OPENCV4_MARKS)") $(OPENCV4_TESTS)
	$(OPENCV4)/bin/python -m benchmarks.hand_eye.peers --cells $(OPENCV4_CELLS)

$(OPENCV4)/installed: pyproject.toml
	@echo "Installing OpenCV 4.14 into $(OPENCV4) (once) ..."
	@$(PYTHON) -m venv $(OPENCV4)
	@$(OPENCV4)/bin/pip --disable-pip-version-check --quiet install --editable . "opencv-python-headless==4.14.*" \
		hypothesis pytest "pytest-asyncio>=1.4" pytest-timeout pytest-xdist trustme
	@touch $@

# The service runs with the system's Python and pinned libraries: Debian 12's is 3.11.2. DEPLOYED_TESTS= chooses others.
DEPLOYED := .venv-deployed
DEPLOYED_PYTHON ?= /usr/bin/python3
DEPLOYED_TESTS ?= tests/daemon/store tests/daemon/cli/test_main.py tests/daemon/cli/test_access_commands.py

test-deployed: export OPENBLAS_NUM_THREADS ?= 1
test-deployed: $(DEPLOYED)/installed
	@$(DEPLOYED)/bin/pip --disable-pip-version-check --quiet install --no-deps --no-build-isolation --force-reinstall .
	$(DEPLOYED)/bin/python --version
	$(DEPLOYED)/bin/python -m pytest -n auto -m "not slow" $(DEPLOYED_TESTS)
	$(DEPLOYED)/bin/handeyed demo

$(DEPLOYED)/installed: pyproject.toml deploy/requirements.lock
	@echo "Installing the deployed libraries into $(DEPLOYED) (once) ..."
	@$(DEPLOYED_PYTHON) -m venv $(DEPLOYED)
	@$(DEPLOYED)/bin/pip --disable-pip-version-check --quiet install --require-hashes --requirement deploy/build.lock
	@$(DEPLOYED)/bin/pip --disable-pip-version-check --quiet install --require-hashes --requirement deploy/requirements.lock
	@$(DEPLOYED)/bin/pip --disable-pip-version-check --quiet install hypothesis pytest "pytest-asyncio>=1.4" pytest-timeout pytest-xdist
	@touch $@

CELLS ?= 20
test-fleet: export OPENBLAS_NUM_THREADS ?= 1
test-fleet: $(VENV)/developing
	HANDEYED_FLEET_CELLS=$(CELLS) $(BIN)/pytest tests/fleet

check: $(VENV)/developing
	.ci/commits
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(VENV)/developing
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: $(VENV)/measuring $(OPENCV4)/installed
	$(BIN)/python -m benchmarks --out docs/benchmarks.md; failed=$$?; \
	$(OPENCV4)/bin/python -m benchmarks hand_eye.peers --out docs/benchmarks.md && exit $$failed

$(VENV)/measuring: $(VENV)/developing
	@echo "Installing the peers to measure against ..."
	@$(PIP) install --group bench
	@touch $@

# Without the internet, once its packages are installed. The wheel and the package take daemon/site with them.
docs: export NO_MKDOCS_2_WARNING := 1
docs: $(VENV)/documenting
	$(BIN)/mkdocs build --quiet
	@echo "daemon/site: handeyed serve shows it under /docs/"

$(VENV)/documenting: $(VENV)/installed
	@echo "Installing mkdocs ..."
	@$(PIP) install --upgrade "pip>=25.1" # Debian 12's pip knows no dependency groups
	@$(PIP) install --group docs
	@touch $@

page-vendor:
	node deploy/page-vendor.mjs

lock: $(VENV)/developing
	@$(PIP) install "uv>=0.9"
	$(LOCK) pyproject.toml --extra las --output-file deploy/requirements.lock # LAZ is a media type of the REST interface
	$(LOCK) --group build --output-file deploy/build.lock

deb:
	@$(MAKE) --no-print-directory docs || echo "mkdocs cannot be had here: the package has no /docs/"
	PYTHON=/usr/bin/python3 deploy/deb/build.sh
	@if command -v lintian >/dev/null; then lintian --fail-on error,warning dist/handeyed_*.deb; else echo "lintian is not here: not checked"; fi

release:
	deploy/release.sh dist/releases $(if $(KEY),--key $(KEY))

# Its deb is packed fast, apart from dist/. SUITE=trixie boots another Debian, in which the deb is built then.
SUITE ?= bookworm
test-systemd: export DEB_COMPRESSION := -Zgzip -z1
test-systemd:
	@rm -f build/systemd/*.deb
	if . /etc/os-release && [ "$$VERSION_CODENAME" = $(SUITE) ]; then PYTHON=/usr/bin/python3 deploy/deb/build.sh build/systemd; \
	else deploy/deb/build-in.sh $(SUITE) build/systemd; fi
	/usr/bin/python3 -m tests.systemd build/systemd/handeyed_*.deb --suite $(SUITE)

ROUNDS ?= 1000
HISTORIES ?= 2000
torture: $(VENV)/developing
	$(BIN)/python -m benchmarks.daemon.torture --rounds $(ROUNDS) --histories $(HISTORIES)

sbom: $(VENV)/developing
	@mkdir -p build
	@sed "s/^dynamic = .*/version = \"$$($(BIN)/python hatch_version.py)\"/" pyproject.toml >build/pyproject.toml # cyclonedx-py builds nothing
	@$(BIN)/cyclonedx-py requirements --pyproject build/pyproject.toml --output-reproducible --output-file build/sbom.cdx.json \
		deploy/requirements.lock
	@echo "build/sbom.cdx.json"

clean:
	rm -rf $(VENV) $(OPENCV4) $(DEPLOYED) build dist .demo daemon/site
