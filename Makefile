# `make` simulates a turntable campaign, processes it and prints its tables; `make help` lists more.
SHELL := bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ROTCLI := $(BIN)/rotcli

# One process a core is what -j is for; a linear algebra library's threads would get in its way.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1

.DELETE_ON_ERROR:
.SUFFIXES:
.SECONDARY:
.PHONY: all campaign tables picture observe srins papers fleet campaign-checks evidence install test test-campaign lint check bench fuzz faults fixtures recorded mutate docs browser clean help

all: tables

# --- installation -------------------------------------------------------------------------------

$(VENV)/installed: pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/installed-dev: pyproject.toml | $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

install: $(VENV)/installed  ## install rotcli into .venv

# --- the campaign: two IMUs, ten rates about z, and still runs (R16 section 4) ---------------------

IMUS := mti-g nav440
RATES := 010 020 030 040 050 060 070 080 090 100
STILLS := 01 02 03 04 05 06 07 08 09 10
TURNING := $(foreach imu,$(IMUS),$(foreach rate,$(RATES),campaign/$(imu)/rate-$(rate)))
STILL := $(foreach imu,$(IMUS),$(foreach run,$(STILLS),campaign/$(imu)/still-$(run)))
CALIBRATIONS := $(TURNING:=/calibration.json)
NAVIGATIONS := $(STILL:=/conventional.json) $(TURNING:=/partial.json) $(TURNING:=/full.json)
ALLANS := $(foreach imu,$(IMUS),campaign/$(imu)/hours/allan.json)
RESULTS := $(CALIBRATIONS) $(NAVIGATIONS) $(ALLANS)
REPORTS := $(addprefix campaign/report.,md csv tex html)

# Of a run such as mti-g/rate-010, nav440/still-03 or mti-g/hours: the IMU, its motion, and a seed
# of its own.
imu_of = $(patsubst %/,%,$(dir $(1)))
number_of = $(lastword $(subst -, ,$(notdir $(1))))
motion_of = $(if $(findstring /rate-,$(1)),--rate $(call number_of,$(1)),\
  --rate 0 $(if $(findstring /hours,$(1)),--static 7200 --navigation 0))
seed_of = $(if $(findstring mti-g,$(1)),1,2)$(if $(findstring /rate-,$(1)),,9)$(filter-out hours,$(call number_of,$(1)))

# One short line a command; `make V=1` shows the complete one.
run = $(if $(V),,@echo "  $(1)" &&) $(ROTCLI) $(2) --quiet

# The truth is written last: a simulation that has it is complete.
campaign/%/imu.parquet campaign/%/table.parquet campaign/%/rig.toml campaign/%/truth.json: | $(VENV)/installed
	$(call run,simulate  $*,simulate --imu $(call imu_of,$*) $(call motion_of,$*) \
	  --seed $(call seed_of,$*) -o campaign/$*)

campaign/%/calibration.json: campaign/%/imu.parquet campaign/%/table.parquet campaign/%/rig.toml campaign/%/truth.json
	$(call run,calibrate $*,calibrate campaign/$*/imu.parquet campaign/$*/table.parquet -o $@)

campaign/%/partial.json campaign/%/full.json: campaign/%/calibration.json campaign/%/imu.parquet campaign/%/table.parquet
	$(call run,navigate  $*,navigate campaign/$*/imu.parquet campaign/$*/table.parquet --mode partial \
	  --mode full --calibration campaign/$*/calibration.json -o 'campaign/$*/{mode}.json')

campaign/%/conventional.json: campaign/%/imu.parquet campaign/%/table.parquet campaign/%/rig.toml campaign/%/truth.json
	$(call run,navigate  $*,navigate campaign/$*/imu.parquet campaign/$*/table.parquet \
	  --mode conventional -o $@)

campaign/%/allan.json: campaign/%/imu.parquet campaign/%/rig.toml campaign/%/truth.json
	$(call run,allan     $*,allan campaign/$*/imu.parquet -o $@)

$(REPORTS): campaign/report.%: $(RESULTS)
	$(call run,report    $@,report $^ --published -o $@)

# R16 figure 6: gyro x of both IMUs, with the published lowest deviations.
campaign/figure-6.png: $(foreach imu,$(IMUS),campaign/$(imu)/hours/imu.parquet campaign/$(imu)/hours/rig.toml)
	$(call run,allan     figure 6,allan $(filter %.parquet,$^) --axes gyro_x --plot $@ --published) >campaign/figure-6.txt

campaign: $(REPORTS) campaign/figure-6.png  ## simulate and process the campaign, write campaign/report.md .csv .tex .html, figure-6.png

tables: campaign  ## the same, and print the summary (the default)
	@$(ROTCLI) report $(RESULTS) --summary --quiet
	@echo "Tables, pages and data: $(REPORTS) campaign/figure-6.png"

# --- the zero-velocity filter: the six runs of O17, tables 1 and 2 ---------------------------------

OBSERVED := still y-level y-pitch-30 z-level z-pitch-30 x-level
motion_still := --axis z --rate 0
motion_y-level := --axis y --rate 10
motion_y-pitch-30 := --axis y --rate 10 --pitch 30
motion_z-level := --axis z --rate 10
motion_z-pitch-30 := --axis z --rate 10 --pitch 30
motion_x-level := --axis x --rate 10

observe/%/imu.parquet observe/%/table.parquet observe/%/rig.toml observe/%/truth.json: | $(VENV)/installed
	$(call run,simulate  observe/$*,simulate --imu mti-g $(motion_$*) --static 0 --rotation 0 \
	  --navigation 300 --seed 17 -o observe/$*)

observe/%/observe.json: observe/%/imu.parquet observe/%/table.parquet observe/%/rig.toml observe/%/truth.json
	$(call run,observe   $*,observe observe/$*/imu.parquet observe/$*/table.parquet -o $@)

observe/report.html: $(OBSERVED:%=observe/%/observe.json)
	$(call run,report    $@,report $^ --published -o $@)

observe: observe/report.html  ## simulate O17's six runs, filter them, print its tables
	@$(ROTCLI) report $(OBSERVED:%=observe/%/observe.json) --summary --quiet
	@echo "Written: $^"

# --- a single-axis rotation INS at sea: a cruise and three maneuvers (the level-damping paper) ----

SRINS_MODES := damped undamped estimated measured
srins_undamped := --no-damping
srins_estimated := --estimated-damping-states --speed-sigma 0
SRINS := srins/cruise/damped.json srins/cruise/undamped.json srins/observability.json \
  $(foreach run,early late follows,srins/$(run)/estimated.json srins/$(run)/measured.json)

# One seed for all voyages: their difference shows what a maneuver does.
srins/%/truth.json: | $(VENV)/installed
	$(call run,simulate  srins/$*,srins simulate -o srins/$* \
	  --seed 1 --scenario $(if $(filter cruise,$*),srins,srins-$*))

define srins_rule
srins/%/$(1).json: srins/%/truth.json
	$$(call run,calibrate srins/$$* $(1),srins calibrate srins/$$*/imu.parquet srins/$$*/table.parquet \
	  --reference srins/$$*/gnss.parquet --speed srins/$$*/doppler.parquet --truth srins/$$*/truth.json \
	  $$(srins_$(1)) -o $$@)
endef
$(foreach mode,$(SRINS_MODES),$(eval $(call srins_rule,$(mode))))

srins/observability.json: srins/cruise/truth.json
	$(call run,observe   srins,srins observe -o $@)

srins/report.md srins/report.html: srins/report.%: $(SRINS)
	$(call run,report    $@,report $^ --published -o $@)

srins: srins/report.md srins/report.html  ## simulate and calibrate the SRINS voyages, write srins/report.md .html
	@$(ROTCLI) report $(SRINS) --summary --quiet
	@echo "Written: $^"

# --- the three papers: all of the above, the figures of single runs, and one table ------------------

# R16 figures 7 and 10: one run of each IMU in all modes; R16 (10) to (25): errors within one turn.
PAPER_FIGURES := $(foreach imu,$(IMUS),papers/one-run-$(imu).png papers/within-turn-$(imu).png) \
  papers/singular-values.png

papers/one-run-%.png: campaign/%/rate-050/calibration.json campaign/%/rate-050/imu.parquet campaign/%/rate-050/table.parquet | papers/made
	$(call run,navigate  $@,navigate campaign/$*/rate-050/imu.parquet campaign/$*/rate-050/table.parquet \
	  --mode partial --mode full --calibration $< --plot $@ -o 'papers/one-run-$*-{mode}.json')

papers/within-turn-%.png: | papers/made
	$(call run,budget    $@,budget --imu $* --rate 10 --within-turn --plot $@ -o papers/within-turn-$*.md)

papers/singular-values.png: | papers/made
	$(call run,observe   $@,srins observe --plot $@ -o papers/singular-values.json)

papers/made: | $(VENV)/installed
	@mkdir -p papers && touch $@

papers: campaign observe/report.html srins/report.html $(PAPER_FIGURES)  ## all of it, and a table: item, ours, published, verdict
	@$(BIN)/python -m tests.campaigns.papers -o papers/summary.md
	@echo "Written: papers/summary.md $(PAPER_FIGURES) $(REPORTS) observe/report.html srins/report.html"

# --- a fleet: 40 units, 8 days, 4 turn-ons; repeatability, charts, yield, and one certificate -------

FLEET := 40,8,4

fleet/truth.json: | $(VENV)/installed
	$(call run,simulate  fleet,simulate --fleet $(FLEET) --seed 1 -o fleet)

fleet/spec.toml: fleet/truth.json
	@printf '[limits]\nbias_z = { min = -30, max = 150, unit = "deg/h", guard = 2.0 }\n' > $@

fleet/fleet.json fleet/fleet.html &: fleet/spec.toml
	$(call run,fleet     fleet,fleet fleet --spec fleet/spec.toml -o fleet/fleet.json --page fleet/fleet.html)

fleet/certificate.html: fleet/fleet.json
	$(call run,certificate SN0001,certificate fleet/SN0001/*/*.json --fleet fleet/fleet.json --spec fleet/spec.toml -o $@)

fleet: fleet/fleet.html fleet/certificate.html  ## simulate results of 40 units, analyse them, certify one
	@$(ROTCLI) fleet fleet --spec fleet/spec.toml --quiet
	@echo "Written: $^"

# The picture of the README.
picture: campaign  ## draw docs/campaign.svg again
	@$(ROTCLI) report $(RESULTS) --figures build/figures --figure-format svg --quiet
	@cp build/figures/nav440-rms-errors-against-the-table-rate.svg docs/campaign.svg

# --- development ------------------------------------------------------------------------------

test: $(VENV)/installed-dev  ## run the tests, one process per core
	$(BIN)/python -m pytest -n auto --dist worksteal

test-campaign: $(VENV)/installed-dev  ## run the long Monte Carlo tests, and the property tests on new examples
	$(BIN)/python -m pytest -n auto -m campaign
	$(BIN)/python -m pytest -n auto -m hypothesis --hypothesis-profile random

lint: $(VENV)/installed-dev  ## check format, style, types, layers, spelling and words
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell rotcli tests docs README.md CHANGELOG.md Makefile
	$(BIN)/python -m tests.words

campaign-checks: $(VENV)/installed-dev  ## the SRINS Monte Carlo checks; their table is kept in docs/evidence/srins-checks.md
	ROTCLI_CAMPAIGN_TABLE=docs/evidence/srins-checks.md $(BIN)/python -m pytest tests/srins -m campaign
	@cat docs/evidence/srins-checks.md

evidence: $(VENV)/installed-dev  ## clean runs and power of the tests again (an hour): docs/evidence/controls.md, power.md
	$(BIN)/python -m tests.campaigns.power
	$(BIN)/python -m tests.campaigns.controls --seeds 200

check: lint test  ## all of lint, and the tests

$(VENV)/installed-bench: pyproject.toml | $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

bench: $(VENV)/installed-bench  ## speed as ratios, side by side with other programs
	$(BIN)/python -m tests.campaigns.benchmarks

$(VENV)/installed-fuzz: pyproject.toml | $(VENV)/installed-dev
	-$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fuzz]'
	@touch $@

$(VENV)/installed-docs: pyproject.toml | $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

docs: $(VENV)/installed-docs  ## renew the reference pages and build the documentation in build/site
	$(BIN)/python -m tests.reference_pages
	$(BIN)/mkdocs build --quiet --strict --config-file .mkdocs.yml

mutate: $(VENV)/installed-dev  ## mutate the mathematics (hours); the tests must notice; docs/evidence/mutants.md
	$(BIN)/python -m tests.campaigns.mutate

fuzz: $(VENV)/installed-fuzz  ## fuzz every reader of files for a minute
	$(BIN)/python -m tests.campaigns.fuzz --seconds 60

faults: $(VENV)/installed-dev  ## run the fault-injection tests (twenty minutes); docs/evidence/faults.md
	$(BIN)/python -m tests.campaigns.faults

fixtures: $(VENV)/installed  ## make the test logs from their seeds
	$(BIN)/python fixtures/make_fixtures.py

# Recordings that a package ships: an Xsens export with a counter, NGIMU, x-io and YEI logs.
recorded: $(VENV)/installed  ## download recorded logs of other devices into build/recorded
	$(BIN)/python -m pip download --quiet --no-deps --only-binary :all: --dest build/wheels \
	  'scikit-kinematics==0.10.4'
	$(BIN)/python -m zipfile -e build/wheels/scikit_kinematics-0.10.4-*.whl build/recorded

browser:  ## install Chromium (Debian, Ubuntu), in which the tests check the HTML pages
	command -v chromium || { $(if $(filter 0,$(shell id -u)),,sudo) apt-get update -q && \
	  $(if $(filter 0,$(shell id -u)),,sudo) apt-get install -y -q --no-install-recommends chromium; }

clean:  ## remove everything made here: the campaign, the environment, caches
	rm -rf campaign observe srins fleet papers build $(VENV) *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

help:  ## this list
	@sed -n 's/^\([a-z][a-z-]*\):.*##  *\(.*\)/  make \1\t\2/p' Makefile | expand -t 24
