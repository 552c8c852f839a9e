# `make reproduce` and `make test` are all a user needs; both set up what they run in.

PYTHON ?= python3
OLDEST_PYTHON ?= python3.11
BIN := .venv/bin
READY := .venv/.ready
WORKBENCH := $(BIN)/workbench
REFERENCE := $(WORKBENCH) --results results/reference run --jobs 2

.DELETE_ON_ERROR:
.PHONY: reproduce reproduce-all test test-all test-only test-all-only mutants test-processors quick lint reference study readings thesis bench report docs notebooks clean

# Run every named problem that is not marked slow, print the table, write the HTML index, and open it
# where somebody looks.
# The first certified figure comes within a minute, and the file is named.
SHOW := $(if $(CI),,--open)
reproduce: $(READY)
	@$(WORKBENCH) run cd/focus/stadiums && $(WORKBENCH) draw results/cd/focus/stadiums --to results/first
	@status=0; $(WORKBENCH) run '*' --jobs 2 || status=$$?; \
	$(WORKBENCH) report $(SHOW) || status=$$?; exit $$status

# The same, with the problems marked slow, which takes some hours.
reproduce-all: $(READY)
	@status=0; $(WORKBENCH) run '*' --slow --jobs 2 || status=$$?; $(WORKBENCH) report || status=$$?; exit $$status

# Two workers, each with one thread for its small matrices: more get in each other's way. Byte code is
# kept, whatever the environment says: many tests start processes, which would compile it each time.
PYTEST := PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

# Lint beside the tests: it keeps one core busy only.
test test-all: $(READY)
	@$(MAKE) --no-print-directory --jobs 2 lint $@-only

test-only: $(READY)
	$(PYTEST) -m "not slow" --sampled

# Every test, in parts that are meant for less than half an hour. What was stopped goes on where it was, and a table
# tells when each part last passed; PART='here/mu-*' runs some of them, and
# `tests/processors/run.py --list 'here/*'` names them.
test-all-only: $(READY)
	$(BIN)/python tests/processors/run.py $(or $(PART),'here/*')

# Broken code and planted wrong answers: does every certificate notice?
mutants: lint
	$(PYTEST) tests/mutants

# Stored runs, printed numbers, all other tests and the chain to the fault filter, on other processors
# and on the oldest NumPy and SciPy. What was stopped goes on where it was; PART='prescott/*' runs a
# part of it, and tests/processors/run.py --list names the parts.
test-processors: $(READY)
	$(BIN)/python tests/processors/run.py $(PART)

# What one runs all day: lint, types, and the tests that the changes since the last commit can reach,
# the nearest first. 5 is pytest's status where no test is left.
CHOSEN := .pytest_cache/chosen.json
quick: lint
	@files=$$($(BIN)/python tests/changed.py $(CHOSEN)) || exit $$?; \
	if [ -n "$$files" ]; then \
	$(PYTEST) -m "not slow" --chosen $(CHOSEN) $$files || [ $$? -eq 5 ]; fi

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Make the committed reference results anew, at a size that a repository can carry.
reference: $(READY)
	rm -rf results/reference
	$(REFERENCE) cd/drives cd/optics cd/red-book cd/focus-error cd/radial-error cd-arm/identification
	$(REFERENCE) 'cd/*/circles' 'cd/*/stadiums' 'cd/*/nominal' 'cd/*/uncertainty-comparison'
	$(REFERENCE) 'cd/*/smallest-area-stadiums'
	$(REFERENCE) 'cd/*/mu-pid-analysis' 'cd/*/nyquist' 'cd/*/five-x' 'cd/*/sensitivity'
	$(REFERENCE) 'cd/*/gain-room' 'cd/*/cover-variants' textbook/real-mu-jump
	$(REFERENCE) 'cd/*/cover-for-control' 'cd/*/fault-filter' 'cd/*/designed-filter'
	$(REFERENCE) 'cd/*/exact-residuals' 'cd/*/residual-index' 'cd/*/observer-bandwidth'
	$(REFERENCE) 'cd/*/integrated-design' 'cd/*/printed-filter'
	$(REFERENCE) 'cd/*/after-defects' 'cd/*/false-detections' --set draws=50
	$(REFERENCE) mass-spring/analysis bench/covers bench/geometry bench/norms bench/matrix-sets bench/mu-yardstick textbook/fault-detection textbook/record-lengths
	$(REFERENCE) '*/controller' unstable-first-order/board 'cd/*/mu-pid' 'cd/*/lower-bandwidth' 'cd/*/switching-stability'
	$(REFERENCE) 'cd/*/closed-loop' 'cd/*/optical-gain' 'cd/*/linearity' --set draws=50
	$(REFERENCE) 'cd/*/response-methods' 'cd/*/multisine-linearity' --set draws=50
	$(REFERENCE) 'cd/*/residuals' 'cd/*/diode-plane' 'cd/*/position-estimator' --set draws=50
	$(REFERENCE) 'cd/*/disturbance-groups' cd/raised-sum --set draws=50
	$(REFERENCE) 'cd/*/strategies' 'cd/*/bandwidth-trade-off' 'cd/*/wrong-rotation' --set draws=50
	$(REFERENCE) 'cd/*/unlike-arms' --set draws=50
	$(REFERENCE) 'cd/*/measured-sensitivity' 'cd/*/gain-control' 'cd/*/ageing' 'cd/*/experiment-settings'
	$(REFERENCE) 'cd/*/excursion' 'cd/*/best-gains' 'cd/*/gain-ramp' cd/playability
	$(REFERENCE) 'cd/*/two-controllers-switched' 'cd/*/state-feedback' 'cd/*/immunity'
	$(REFERENCE) cd/focus/cover-front --slow --set frequencies=30 --set cover=joint
	$(REFERENCE) cd/focus/start-up cd/radial/track-jump 'cd/*/controller-change' 'cd/*/recovery' cd/two-axes cd/sums cd/diodes cd/diode-map cd/sledge cd/disc-servo
	$(REFERENCE) 'cd/*/methods' 'cd/*/controllers'
	$(REFERENCE) cd/focus/identified cd/radial/identified
	$(REFERENCE) cd/claims
	$(REFERENCE) 'textbook/*/rational-model' 'textbook/*/record-feedback' 'textbook/*/estimate-to-mu' --slow
	$(REFERENCE) textbook/experiment-design '*/reduction' --slow
	$(REFERENCE) textbook/estimate-regions --set estimates=20
	$(REFERENCE) textbook/experiment-times --set draws=10
	$(REFERENCE) two-by-two/matrix-cover --set plants=5 --set frequencies=40 --set order=2
	$(REFERENCE) mass-spring/demands --set orders='[1,2]'
	$(REFERENCE) unstable-first-order/demands
	$(REFERENCE) 'cd/*/two-controllers' --slow --set designs=2 --set frequencies=100
	$(REFERENCE) cd/focus/loop-models
	$(REFERENCE) cd/playability-full --set scenarios=20 --set workers=1
	$(REFERENCE) 'strangers/*/truth'
	$(REFERENCE) bench/cd-arm
	$(REFERENCE) bench/mu-lower-yardstick --set rounds=1
	$(REFERENCE) bench/mu --set frequencies=50 --set peers=5 --set most=1000 --set largest=6
	$(REFERENCE) bench/synthesis --set largest=10 --set plants=1 --set distillation=false --set drives=false
	rm -rf results/reference/.partial

# Numbers of the runs that show other readings of the thesis, which the ledger holds as a table.
readings: $(READY)
	$(BIN)/python docs/readings.py

# The pages about the thesis, from the reference results.
thesis: $(READY)
	$(BIN)/python docs/thesis.py

# Compare all methods on all problems that are not slow (half an hour on two cores), store it, write its page.
# What is stopped goes on where it was. Cells without a certificate are no failure of the study.
study: $(READY)
	-$(WORKBENCH) --results results/study compare '*' --all-methods --light --time-limit 10 \
		--jobs 2
	rm -rf results/reference/compare results/reference/cells
	cp -r results/study/compare results/study/cells results/reference/
	$(BIN)/python docs/study.py

# The workbench beside its peers (a quarter of an hour), and the page about it.
bench: $(READY)
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python docs/benchmarks.py

# The technical report as a PDF, from docs/report, the reference results and the page of benchmarks.
report: $(READY)
	$(BIN)/python docs/report/report.py
	@echo "open docs/report/report.pdf"

# Run the notebooks of the course and keep their outputs.
notebooks: $(READY)
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m workbench.course.execution notebooks/[0-9]*.ipynb

# The site, below docs/_build/html. What is slow to make is kept from one build to the next.
docs: $(READY)
	$(BIN)/python -m sphinx -W --keep-going -b html docs docs/_build/html
	@echo "open docs/_build/html/index.html"

$(READY): requirements.txt pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --requirement requirements.txt
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

.venv-oldest/.ready: requirements.txt pyproject.toml tests/processors/oldest.py
	$(OLDEST_PYTHON) -m venv .venv-oldest
	$(OLDEST_PYTHON) tests/processors/oldest.py > .venv-oldest/requirements.txt
	.venv-oldest/bin/python -m pip install --quiet --only-binary :all: --requirement .venv-oldest/requirements.txt
	.venv-oldest/bin/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@

clean:
	rm -rf .venv .venv-oldest .processors .mypy_cache .ruff_cache .pytest_cache .hypothesis dist
	find workbench problems tests -name __pycache__ -prune -exec rm -rf {} +
