# make demo    set up and render the demo's films and stills into demo/
# make test    set up, lint, and run all tests
# make bench   print speeds; make performance writes docs/internals/performance.md
# make test-hosts     test the transforms of torchvision, kornia and albumentations, installed for it
# make wheel          build the wheel and the source archive into dist/; make test-wheel tries both
# make docs    build the documentation site into site/, notebooks and all, some minutes; QUICK=1 without outputs
# make soak    kill, interrupt and damage by the hundred: docs/internals/reliability.md, some half an hour
# make asan    the kernels' tests and random calls under AddressSanitizer: a nightly toolchain and gcc
# make LICENSE-CRATES   the notices of all crates in the wheel
# make audit   licences, sources and known holes of all crates, licences of all packages: cargo-deny
# make test-lowest    the suite with the lowest versions that pyproject.toml lets in
# make test-browser   test the viewer and the site's search in a real browser: chromium, from apt where it is missing
#
# Both make a virtual environment in .venv and need Python 3.10 or newer, a Rust toolchain and the
# package registries. PYTHON=python3.12 make test chooses another Python.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2

# Tests start Python some hundred times: without bytecode each would compile the package again.
unexport PYTHONDONTWRITEBYTECODE

RUST := $(shell find src crates -name '*.rs' 2>/dev/null) Cargo.toml crates/dispatch/Cargo.toml crates/fft/Cargo.toml pyproject.toml

.PHONY: docs links demo test kernels asan audit test-lowest test-browser test-clients test-hosts test-hosts-older wheel test-wheel peers accuracy mutations \
	lint lint-rust lint-python lint-types bench bench-check performance hashes soak clean requirements

demo: $(VENV)/.installed
	$(BIN)/flurries demo --output demo

# The compiler of the extension has work for one processor: packages, lint and kernels are the other's.
test: | requirements
	$(MAKE) --no-print-directory --jobs 2 lint kernels
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal --quiet

kernels: lint-rust
	cargo test --workspace --quiet

# Rust's runtime is linked into programs alone: the extension, which Python loads, takes gcc's.
SANITIZED := target/asan
HOST = $(shell rustc -vV | sed -n 's/^host: //p')
SANITIZE = ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=0 RUSTFLAGS=-Zsanitizer=address \
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python CARGO_TARGET_DIR=$(SANITIZED)
asan: $(VENV)/.tools
	$(SANITIZE) cargo +nightly test --workspace --quiet --target $(HOST)
	$(SANITIZE) cargo +nightly build --lib --features python --quiet --target $(HOST)
	rm -rf $(SANITIZED)/python && cp -r python $(SANITIZED)/python
	cp $(SANITIZED)/$(HOST)/debug/lib_core.so $(SANITIZED)/python/flurries/_core.abi3.so
	$(SANITIZE) LD_PRELOAD=$$(gcc -print-file-name=libasan.so) PYTHONPATH=$(SANITIZED)/python \
		FLURRIES_SOAK=$(LENGTH) $(BIN)/python -m pytest --quiet -n 0 tests/soak/test_soak_input.py -k random

audit: $(VENV)/.tools
	@command -v cargo-deny >/dev/null || { echo "missing: cargo-deny (cargo install cargo-deny)"; exit 1; }
	cargo deny --all-features check licenses bans sources
	cargo deny --all-features check advisories \
		|| { cargo deny fetch db >/dev/null 2>&1 && exit 1; echo "advisories: their database is out of reach"; }
	$(BIN)/python tests/licences.py

# The notices of the crates that the extension is compiled of, which the wheel carries; their MIT licence where there is a choice.
LICENSE-CRATES: Cargo.lock Cargo.toml
	cargo tree --locked --edges normal --features python --target all --prefix none --format '{p}|{l}' \
	| sed -E 's/ \(\*\)$$//; s/ \(proc-macro\)//' | grep -v '^flurries' | sort -u | while IFS='|' read -r crate licence; do \
		folder=$$(echo $${CARGO_HOME:-$$HOME/.cargo}/registry/src/*/$${crate% v*}-$${crate##* v}); \
		printf '\n======== %s (%s)\n\n' "$$crate" "$$licence"; \
		find "$$folder" -maxdepth 1 -iname 'licen[cs]e-mit*' -o -maxdepth 1 -iname 'licen[cs]e*unicode*' | sort | xargs -r -d '\n' cat > $@.part; \
		test -s $@.part || find "$$folder" -maxdepth 1 -iname 'licen[cs]e*' | sort | xargs -r -d '\n' cat > $@.part; \
		test -s $@.part || echo "$$crate has no licence file" >&2; \
		cat $@.part; \
	done > $@ && rm -f $@.part

# In an environment of its own, .venv-lowest.
test-lowest: $(VENV)/.made
	test -x .venv-lowest/bin/python || $(PYTHON) -m venv .venv-lowest
	$(BIN)/python tests/packages.py > .venv-lowest/lowest.txt
	.venv-lowest/bin/python -m pip install --quiet --disable-pip-version-check -r .venv-lowest/lowest.txt
	VIRTUAL_ENV=$(CURDIR)/.venv-lowest $(BIN)/maturin develop --release --quiet
	.venv-lowest/bin/python -m pytest -n $(WORKERS) --dist worksteal --quiet

test-browser: $(VENV)/.tools
	@command -v chromium >/dev/null || command -v google-chrome >/dev/null \
		|| { command -v apt-get >/dev/null && apt-get install --yes --no-install-recommends chromium; } \
		|| { echo "missing: chromium (on Debian: apt install chromium)"; exit 1; }
	$(BIN)/maturin develop --release --quiet --extras test,browser,docs
	$(BIN)/python -m pytest --quiet tests/browser

# The programs that take our files: Debian's by apt-get, Blender and OpenEXR from PyPI (400 MB) where this
# Python has them. What cannot be had is named, and its tests are left out.
CLIENTS := oiiotool:openimageio-tools exrheader:openexr ffprobe:ffmpeg
test-clients: $(VENV)/.tools
	@for client in $(CLIENTS); do \
		command -v $${client%%:*} >/dev/null \
		|| { command -v apt-get >/dev/null && apt-get install --yes --no-install-recommends $${client##*:}; } \
		|| echo "missing: $${client%%:*} (on Debian: apt install $${client##*:})"; \
	done
	@for module in OpenEXR bpy==5.0.1 'numpy>=2'; do \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check $$module \
		|| echo "missing: $$module, which PyPI has for Python 3.11"; \
	done
	$(BIN)/python -m pytest --quiet -ra tests/clients

# Each in an environment of its own, .venv-hosts and .venv-hosts-older; about 3 GB, since torch from
# PyPI brings CUDA. TORCH_INDEX=https://download.pytorch.org/whl/cpu takes the one without.
TORCH_INDEX ?=
test-hosts: HOSTS := newest
test-hosts-older: HOSTS := older
test-hosts test-hosts-older: $(VENV)/.made
	test -x .venv-$(@:test-%=%)/bin/python || $(PYTHON) -m venv .venv-$(@:test-%=%)
	.venv-$(@:test-%=%)/bin/python -m pip install --quiet --disable-pip-version-check \
		$(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX)) --requirement tests/hosts/$(HOSTS).txt
	VIRTUAL_ENV=$(CURDIR)/.venv-$(@:test-%=%) $(BIN)/maturin develop --release --quiet
	.venv-$(@:test-%=%)/bin/python -m pytest --quiet tests/hosts

# zig links against an old glibc, so that the wheel is manylinux2014's: any Linux since 2014.
COMPATIBILITY ?= manylinux2014
wheel: $(VENV)/.made
	$(BIN)/python -m pip install --quiet --disable-pip-version-check ziglang
	rm -rf dist
	# No paths of the machine that builds in what is given away.
	PATH="$(CURDIR)/$(BIN):$$PATH" VIRTUAL_ENV="$(CURDIR)/$(VENV)" \
	RUSTFLAGS="--remap-path-prefix=$${CARGO_HOME:-$$HOME/.cargo}=cargo --remap-path-prefix=$(CURDIR)=." \
	$(BIN)/maturin build --release --quiet --zig \
		--compatibility $(COMPATIBILITY) --out dist
	$(BIN)/maturin sdist --out dist

# Installs dist/ where there is no Rust, and runs the suite there; then builds the source archive.
test-wheel: wheel
	$(PYTHON) tests/wheel/check.py dist

# Our weather for data sets beside that of the usual libraries: docs/internals/peers.md.
peers:
	$(PYTHON) benches/peers.py --page docs/internals/peers.md

# Error against time of every approximation: docs/internals/accuracy.md and its plots, about a minute.
accuracy: $(VENV)/.tools
	$(BIN)/python benches/accuracy.py --write

# Changes at random places of the package, each seen by a test: COUNT of them, drawn with SEED.
COUNT ?= 60
SEED ?= 1
mutations: $(VENV)/.tools
	$(BIN)/python tests/mutations.py --count $(COUNT) --seed $(SEED)

# Without the network: pages, gallery, notebooks and a reference made from the code. Warnings and lost
# links are errors.
QUICK ?=
docs: $(VENV)/.tools
	$(BIN)/maturin develop --release --quiet --extras video,docs
	$(BIN)/python docs/site/build.py $(if $(QUICK),--quick)

# Absolute links for a package index. The address is known to who publishes: BASE=https://host/owner/flurries
links:
	$(PYTHON) docs/site/absolute.py $(BASE)

lint: lint-python lint-types lint-rust

lint-rust: | requirements
	@cargo clippy --version >/dev/null 2>&1 && cargo fmt --version >/dev/null 2>&1 \
		|| { echo "missing: clippy and rustfmt (rustup component add clippy rustfmt)"; exit 1; }
	cargo fmt --all --check
	cargo clippy --workspace --all-targets --features flurries/python --quiet -- --deny warnings

lint-python: $(VENV)/.tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/basedpyright
	$(BIN)/stubtest flurries._core --mypy-config-file pyproject.toml

lint-types: $(VENV)/.tools
	$(BIN)/mypy
	$(BIN)/mypy --strict examples/*.py

# Ratios, sizes, whole frames, and what is around the kernels.
performance: $(VENV)/.tools
	$(BIN)/python benches/speed.py --page docs/internals/performance.md

bench: $(VENV)/.tools
	$(BIN)/python benches/speed.py
	$(BIN)/python benches/files.py
	$(BIN)/python benches/gas.py
	$(BIN)/python benches/cone.py

# Fails where a limit is missed by 15 %, on a quiet machine.
bench-check: $(VENV)/.tools
	$(BIN)/python benches/files.py --check

# Hashes of frames in the reproducible mode; a change wants a line in the changelog.
hashes: $(VENV)/.tools
	$(BIN)/python tests/same_bits.py --take

# Kills, interruptions, damaged files, forks and leaks by the hundred: docs/internals/reliability.md, some half
# an hour; LENGTH=0.1 takes a tenth of it.
LENGTH ?= 1
soak: $(VENV)/.tools
	FLURRIES_SOAK=$(LENGTH) $(BIN)/python -m pytest -q -n 0 tests/soak tests/test_faults.py

clean:
	rm -rf $(VENV) target build demo dist site

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

$(VENV)/.built: $(VENV)/.made $(RUST)
	$(BIN)/maturin develop --release --quiet --skip-install
	touch $@

$(VENV)/.packages: $(VENV)/.made pyproject.toml
	$(BIN)/python tests/packages.py test lint > $@.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r $@.txt
	touch $@

$(VENV)/.installed: $(VENV)/.built
	$(BIN)/maturin develop --release --quiet --extras video
	touch $@

$(VENV)/.tools: $(VENV)/.built $(VENV)/.packages
	$(BIN)/maturin develop --release --quiet --extras test,lint
	touch $@
