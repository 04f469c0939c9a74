# make demo    set up and render the demo's films and stills into demo/
# make test    set up, lint, and run all tests
# make bench   print the speeds that the README quotes
# make soak    kill, interrupt and damage by the hundred: docs/reliability.md, some half an hour
# make test-browser   test the viewer in a real browser: chromium, from apt where it is missing
#
# Both make a virtual environment in .venv and need Python 3.10 or newer, a Rust toolchain and the
# package registries. PYTHON=python3.12 make test chooses another Python.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2

RUST := $(shell find src crates -name '*.rs' 2>/dev/null) Cargo.toml crates/fft/Cargo.toml pyproject.toml

.PHONY: demo test test-browser hard-cases accuracy mutations lint bench frames hashes soak clean requirements

demo: $(VENV)/.installed
	$(BIN)/flurries demo --output demo

test: lint
	cargo test --workspace --quiet
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --quiet

test-browser: $(VENV)/.tools
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null \
		|| { command -v apt-get >/dev/null && apt-get install --yes --no-install-recommends chromium; } \
		|| { echo "missing: chromium (on Debian: apt install chromium)"; exit 1; }
	$(BIN)/maturin develop --release --quiet --extras test,browser
	$(BIN)/python -m pytest --quiet tests/browser

# The measured value of every hard case beside the expected one: docs/hard-cases.md.
hard-cases: $(VENV)/.tools
	PYTHONPATH=tests $(BIN)/python tests/make_hard_cases.py

# Error against time of every approximation: docs/accuracy.md and its plots, some ten minutes.
accuracy: $(VENV)/.tools
	$(BIN)/flurries accuracy -o docs/images/accuracy --page docs/accuracy.md

# Guards are taken away one at a time; WHAT=python leaves out those that need a build each.
WHAT ?= all
mutations: $(VENV)/.tools
	$(BIN)/python tests/mutations.py $(WHAT)

lint: $(VENV)/.tools
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --quiet -- --deny warnings
	cargo clippy --all-targets --features python --quiet -- --deny warnings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/stubtest flurries._core --mypy-config-file pyproject.toml

bench: $(VENV)/.tools
	$(BIN)/python benches/speed.py
	$(BIN)/python benches/gas.py
	$(BIN)/python benches/cone.py

# Reference frames come from the tests' independent twin, never from the kernels.
frames: $(VENV)/.tools
	$(BIN)/python tests/make_frames.py

# Hashes of frames in the reproducible mode; a change wants a line in the changelog.
hashes: $(VENV)/.tools
	$(BIN)/python tests/make_hashes.py

# Kills, interruptions, damaged files, forks and leaks by the hundred: docs/reliability.md, some half
# an hour; LENGTH=0.1 takes a tenth of it.
LENGTH ?= 1
soak: $(VENV)/.tools
	FLURRIES_SOAK=$(LENGTH) $(BIN)/python tests/make_reliability.py

clean:
	rm -rf $(VENV) target demo dist

requirements:
	@command -v $(PYTHON) >/dev/null || { echo "missing: $(PYTHON) (Python 3.10 or newer)"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' \
		|| { echo "missing: Python 3.10 or newer; $(PYTHON) is $$($(PYTHON) --version)"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null \
		|| { echo "missing: the venv module (on Debian: apt install python3-venv)"; exit 1; }
	@command -v cargo >/dev/null \
		|| { echo "missing: cargo (a Rust toolchain, 1.89 or newer: https://rustup.rs)"; exit 1; }

$(VENV)/.made: | requirements
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'maturin>=1.16,<2'
	touch $@

$(VENV)/.installed: $(VENV)/.made $(RUST)
	$(BIN)/maturin develop --release --quiet
	touch $@

$(VENV)/.tools: $(VENV)/.installed
	@cargo clippy --version >/dev/null 2>&1 && cargo fmt --version >/dev/null 2>&1 \
		|| { echo "missing: clippy and rustfmt (rustup component add clippy rustfmt)"; exit 1; }
	$(BIN)/maturin develop --release --quiet --extras test,lint
	touch $@
