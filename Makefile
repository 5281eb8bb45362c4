# make demo    survey, fit, compensate and check the sample programs on a virtual arm
# make test    all tests but the slow ones
# make slow    whole searches and fits of many drawn surveys, which `make test` leaves out
# make lint    ruff, mypy, and the words of names, help, messages and pages
# make lock    pin what is installed, in requirements/; UPGRADE=1: to the newest versions
# make chaos   kill 200 batches of 300 files at random moments and resume them; end 50 long runs by signals
# make awkward   200 drawn surveys of every awkward kind: fitted, or refused in words
# make fuzz    20,000 damaged programs, PDL2, RAPID and KRL: refused, or rewritten byte for byte; the parsers by coverage
# make plant-bench   10,000 files, a second run, memory, workers, a cluster: docs/studies/plant.md
# make generated    1,000 random programs a language: followed as they run, landing where they say
# make golden  what the commands write, here and at BASE=<commit>: a changed byte fails
# make bench   where the time goes on this machine: docs/studies/benchmarks.md
# make growth  how the time to read a program grows with its lines, variables and branches
# make evidence    coverage of the intervals, and what direction is worth
# make reproduce   the published method and ours, simulated: docs/studies/reproduction.md
# make accuracy    held-out errors, coverage, real and blind data: docs/studies/accuracy.md
# make intervals   coverage of a reading's intervals on two real arms: docs/studies/intervals.md
# make detection   outliers, wrong directions and nests that a fit finds: docs/studies/detection.md
# make languages   where arms land that run one job in every language: docs/languages.md
# make campaigns    repeats, nests, rounds, rounded angles: fits of 200 drawn campaigns, docs/studies/campaigns.md
# make undeclared  undeclared effects traced on virtual arms, 1,880 of them: docs/studies/undeclared.md
# make paths       predicted and true path accuracy on virtual arms: docs/studies/paths.md
# make real DATA=folder [FITS=1]   real arms, rows that nothing has seen; FITS leaves out diagnoses: docs/studies/real-arms.md
# make blind       effects traced in the blind campaigns and on a real arm: docs/studies/blind.md
# make wheel       a wheel for every Python from 3.11 on, tried in a new environment, in dist
# make wheels  the same, and one for Windows, cross-built: needs rustup and mingw-w64
# make windows     try that one under Wine: same bytes as here; needs wine and maven, too
# make native      lint and tests of the native core by itself, for who changes it
# make docs     run every command of the documentation, write it as a site to build/docs
# make pictures remake the pictures of the documentation (needs chromium, chromium-driver)
# Each target first creates the environment .venv when it is missing or out of date.

VENV ?= .venv
PYTHON_BIN := $(VENV)/bin/python
STAMP := $(VENV)/.installed

# Small matrices: two processes gain more than two threads inside one.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help demo test slow lint format bench evidence reproduce accuracy intervals detection undeclared paths blind real chaos fuzz docs clean
.PHONY: campaigns languages plant-bench generated growth awkward native golden pictures lock wheel wheels windows
.DELETE_ON_ERROR:

help:
	@sed -n 's/^# //p' Makefile

$(STAMP): pyproject.toml .ci/venv $(wildcard requirements/*.txt native/* native/src/*.rs)
	@bash .ci/venv $(VENV)
	@touch $@

demo: $(STAMP)
	@PATH="$(abspath $(VENV))/bin:$$PATH" bash programs/demo.sh

test: $(STAMP)
	@$(PYTHON_BIN) -m pytest -n 2 --dist loadfile

slow: $(STAMP)
	@$(PYTHON_BIN) -m pytest -n 2 --dist loadfile -m slow

lint: $(STAMP)
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/ruff format --check .
	@$(VENV)/bin/mypy
	@$(PYTHON_BIN) docs/tools/words.py
	@$(PYTHON_BIN) docs/tools/pages.py

lock:
	@PATH="$(abspath $(VENV))/bin:$$PATH" bash .ci/lock $(if $(UPGRADE),--upgrade)

format: $(STAMP)
	@$(VENV)/bin/ruff check --fix .
	@$(VENV)/bin/ruff format .

bench: $(STAMP)
	@$(PYTHON_BIN) -m tests.bench

growth: $(STAMP)
	@$(PYTHON_BIN) -m tests.bench.growth

evidence: $(STAMP)
	@$(PYTHON_BIN) -m tests.evidence

reproduce: $(STAMP)
	@cd docs/studies && $(abspath $(PYTHON_BIN)) reproduction.py --centres 60 --arms 40

accuracy: $(STAMP)
	@PYTHONPATH=. $(PYTHON_BIN) docs/studies/accuracy.py --seeds 20

intervals: $(STAMP)
	@PYTHONPATH=. $(PYTHON_BIN) docs/studies/intervals.py --seeds $(or $(SEEDS),20)

detection: $(STAMP)
	@PYTHONPATH=. $(PYTHON_BIN) docs/studies/detected.py --seeds $(or $(SEEDS),40)

languages: $(STAMP)
	@$(PYTHON_BIN) -m tests.language.true_error

campaigns: $(STAMP)
	@$(PYTHON_BIN) -m tests.campaigns --count $(or $(COUNT),200) --jobs $(or $(JOBS),2)

undeclared: $(STAMP)
	@$(PYTHON_BIN) -m tests.undeclared --seeds $(or $(SEEDS),60) --none $(or $(NONE),200)

paths: $(STAMP)
	@PYTHONPATH=. $(PYTHON_BIN) docs/studies/paths.py $(if $(SEEDS),--seeds $(SEEDS))

blind: $(STAMP)
	@PYTHONPATH=. $(PYTHON_BIN) docs/studies/diagnosed.py

real: $(STAMP)
	@test -n "$(DATA)" || { echo "make real DATA=folder: see docs/studies/real-arms.md" >&2; exit 2; }
	@PYTHONPATH=. $(PYTHON_BIN) docs/studies/real_arms.py "$(DATA)" --jobs $(or $(JOBS),1) $(if $(QUICK),--quick -o build/real-arms.md) $(if $(FITS),--no-diagnosis)

chaos: $(STAMP)
	@$(PYTHON_BIN) -m tests.chaos --runs $(or $(RUNS),200) --files $(or $(FILES),300) --signals $(or $(SIGNALS),50)

fuzz: $(STAMP)
	@$(PYTHON_BIN) -m tests.fuzz --count $(or $(COUNT),20000)
	@$(PYTHON_BIN) -c 'import atheris' 2>/dev/null || $(PYTHON_BIN) -m pip install --quiet --require-hashes -r requirements/fuzz.txt || true
	@$(PYTHON_BIN) -m tests.fuzz.guided --runs $(or $(RUNS),20000)

WINDOWS := x86_64-pc-windows-gnu
wheels: wheel
	@PATH="$$PATH:$$HOME/.cargo/bin"; rustup target list --installed 2>/dev/null | grep -q $(WINDOWS) || \
		rustup target add $(WINDOWS) || { echo "make wheels needs Rust for Windows: rustup target add $(WINDOWS)" >&2; exit 2; }
	@command -v x86_64-w64-mingw32-gcc >/dev/null || { echo "make wheels needs mingw-w64: apt install gcc-mingw-w64-x86-64" >&2; exit 2; }
	@PATH="$$PATH:$$HOME/.cargo/bin" CARGO_BUILD_TARGET=$(WINDOWS) $(PYTHON_BIN) -m pip --quiet \
		--disable-pip-version-check wheel --no-deps --no-build-isolation -w dist .
	@ls dist/postproc-*.whl

windows: $(STAMP)
	@PYTHON=$(abspath $(PYTHON_BIN)) bash .ci/windows

native: $(STAMP)
	@cd native && PATH="$$PATH:$$HOME/.cargo/bin" && cargo fmt --check && \
		cargo clippy --release -- -D warnings && \
		PYO3_PYTHON=$(abspath $(PYTHON_BIN)) cargo test --release --no-default-features
	@$(PYTHON_BIN) -m pytest tests/test_native.py

wheel: $(STAMP)
	@$(PYTHON_BIN) -m pip --quiet --disable-pip-version-check wheel --no-deps \
		--no-build-isolation -w dist .
	@bash .ci/try-wheel dist/postproc-*-abi3-*.whl

docs: $(STAMP)
	@PATH="$(abspath $(VENV))/bin:$$PATH" python docs/tools/build.py $(UPDATE)

golden: $(STAMP)
	@$(PYTHON_BIN) -m tests.golden against $(or $(BASE),HEAD) $(if $(ONLY),--only '$(ONLY)')

pictures: $(STAMP)
	@PYTHONPATH=. $(PYTHON_BIN) docs/tools/pictures.py
	@$(PYTHON_BIN) docs/tools/architecture.py
	@PYTHONPATH=. $(PYTHON_BIN) docs/tools/screenshot.py

plant-bench: $(STAMP)
	@$(PYTHON_BIN) -m tests.plant_bench --files $(or $(FILES),10000)

awkward: $(STAMP)
	@$(PYTHON_BIN) -m tests.awkward --count $(or $(COUNT),200)

generated: $(STAMP)
	@for language in own pdl2 rapid krl; do $(PYTHON_BIN) -m tests.generated \
		--count $(or $(COUNT),1000) --language $$language || exit 1; done

clean:
	rm -rf $(VENV) demo build dist .cache .pytest_cache .mypy_cache .ruff_cache .hypothesis native/target
