# A fresh machine needs Python >= 3.11 and its venv module; every target below sets up what it uses.
PYTHON ?= python3
TORCH ?= torch==2.13.0
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu# without gigabytes of CUDA; for a GPU: https://pypi.org/simple
VENV ?= .venv
DEVKIT ?= .devkit
DEMO ?= demo
VELOCITY ?= velocity
TRAFFIC ?= traffic
ABLATION ?= ablation
SIZE ?= small
RUN = $(VENV)/bin/python
READY = $(VENV)/.ready

.PHONY: setup devkit demo velocity ablation test lint bench clean distclean

setup: $(READY)

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --upgrade pip
	$(RUN) -m pip install --quiet --no-deps --extra-index-url $(TORCH_INDEX) "$(TORCH)"
	$(RUN) -m pip install --quiet --editable '.[dev]'
	touch $(READY)

# The official nuScenes evaluators, for the tests that compare with them; their pins want an environment of their own.
devkit: $(DEVKIT)/.ready

$(DEVKIT)/.ready:
	$(PYTHON) -m venv $(DEVKIT)
	$(DEVKIT)/bin/python -m pip install --quiet nuscenes-devkit==1.2.0
	touch $(DEVKIT)/.ready

STREETS = dataset=simulated dataset.root=$(DEMO)/streets
MODEL = $(DEMO)/run/checkpoints/membership-last.ckpt

# Simulate streets, train both stages on some, label others in two ways, score them, draw one.
demo: setup
	rm -rf $(DEMO)/run $(DEMO)/full $(DEMO)/nearest
	$(RUN) -m most.simulate simulation=demo out=$(DEMO)/streets
	$(RUN) -m most.train +experiment=sim_demo dataset.root=$(DEMO)/streets dataset.tables=$(DEMO)/tables \
	  hydra.run.dir=$(DEMO)/run
	$(RUN) -m most.predict checkpoint=$(MODEL) split=test out=$(DEMO)/nearest membership=nearest $(STREETS)
	$(RUN) -m most.predict checkpoint=$(MODEL) split=test out=$(DEMO)/full $(STREETS)
	$(RUN) -m most.evaluate predictions=$(DEMO)/nearest split=test out=$(DEMO)/nearest.json $(STREETS)
	$(RUN) -m most.evaluate predictions=$(DEMO)/full split=test out=$(DEMO)/metrics.json $(STREETS)
	$(RUN) -m most.draw predictions=$(DEMO)/full sequence="'20'" index=5 out=$(DEMO)/sweep.png $(STREETS)
	$(RUN) -m most.compare 'reports={nearest: $(DEMO)/nearest.json, full: $(DEMO)/metrics.json}'
	@echo "tables: above, in $(DEMO)/metrics.json and $(DEMO)/nearest.json; picture: $(DEMO)/sweep.png"

FOLLOWED = $(VELOCITY)/$(TRAFFIC)
SCANS = dataset=$(TRAFFIC) dataset.root=$(FOLLOWED)/scans dataset.tables=$(FOLLOWED)/tables
OPTIONS_traffic_10hz = stage.detection.epochs=12 trainer.validate_every=12# ten sweeps are a second there, and take longer
LEARNED = $(FOLLOWED)/run/checkpoints/detection-last.ckpt

# Do predicted velocities help to track at 2 Hz? TRAFFIC=traffic_10hz: at every fifth of ten scans a second.
# What is finished is skipped, so that an interrupted run goes on.
velocity: setup
	$(if $(filter traffic traffic_10hz,$(TRAFFIC)),,$(error TRAFFIC: expected traffic or traffic_10hz, found $(TRAFFIC)))
	$(RUN) -m most.simulate simulation=$(TRAFFIC) out=$(FOLLOWED)/scans
	test -f $(FOLLOWED)/run/metrics.json || $(RUN) -m most.train +experiment=sim_velocity $(SCANS) $(OPTIONS_$(TRAFFIC)) \
	  hydra.run.dir=$(FOLLOWED)/run $$(test ! -f $(LEARNED) || echo resume=$(LEARNED))
	$(RUN) -m most.predict checkpoint=$(LEARNED) split=test out=$(FOLLOWED)/predictions $(SCANS)
	for motion in velocity nearest; do \
	  $(RUN) -m most.track predictions=$(FOLLOWED)/predictions split=test out=$(FOLLOWED)/$$motion \
	    tracker.motion=$$motion $(SCANS) || exit; done
	$(RUN) -m most.velocity velocity=$(FOLLOWED)/velocity nearest=$(FOLLOWED)/nearest split=test \
	  out=$(FOLLOWED)/velocity.json $(SCANS)

# Rows of Tables I and II. The paper's Table II stands on shrink-wrapped extents: its last row is the first one's of
# Table I, nearest centres are scored beside each run, and clustering is put on the same stage 1.
EXTENTS = shrink_wrap,track_max
MORE_EXTENTS = drop_small,class_mean,amodal
MEMBERSHIPS = geometric,geometric_bev
EXPERIMENT_small = sim_ablation_small
EXPERIMENT_full = sim_ablation
DATASET_small = ablation_small
DATASET_full = ablation
SEEDS_small = 1
SEEDS_full = 1,2,3,4,5
FEWER_SEEDS_small = 1
FEWER_SEEDS_full = 1,2,3# of all rows but shrink_wrap, track_max and the memberships
ALONE_small = hydra.launcher.n_jobs=1# a seed is one job, and gets all cores
SWEPT = $(ABLATION)/$(SIZE)
SWEEP = $(RUN) -m most.train -m +experiment=$(EXPERIMENT_$(SIZE)) hydra.sweep.dir=$(SWEPT) \
  hydra/launcher=processes dataset.root=$(ABLATION)/streets dataset.tables=$(ABLATION)/tables
HELD_OUT = split=val dataset=$(DATASET_$(SIZE)) dataset.root=$(ABLATION)/streets
STAGE1 = $(SWEPT)/extent-shrink_wrap+seed-
comma := ,

# The paper's ablations on simulated streets. What is finished is skipped, so that an interrupted run goes on.
ablation: setup
	$(if $(EXPERIMENT_$(SIZE)),,$(error SIZE: expected small or full, found $(SIZE)))
	$(RUN) -m most.simulate simulation=ablation out=$(ABLATION)/streets
	$(SWEEP) extent=$(EXTENTS) seed=$(SEEDS_$(SIZE))
	$(SWEEP) extent=shrink_wrap seed=$(SEEDS_$(SIZE)) membership=$(MEMBERSHIPS) stage=membership 'stage1=$(STAGE1)$${seed}'
	$(SWEEP) extent=$(MORE_EXTENTS) seed=$(FEWER_SEEDS_$(SIZE))
	$(SWEEP) extent=shrink_wrap backbone.separate=true seed=$(FEWER_SEEDS_$(SIZE)) $(ALONE_$(SIZE))
	$(SWEEP) extent=shrink_wrap heads=offset_regression stage=detection seed=$(FEWER_SEEDS_$(SIZE)) $(ALONE_$(SIZE))
	for seed in $(subst $(comma), ,$(SEEDS_$(SIZE))); do run=$(STAGE1)$$seed; \
	  test ! -f $$run/evaluated/clustering.json || continue; \
	  $(RUN) -m most.predict checkpoint=$$run/checkpoints/detection-last.ckpt membership=clustering \
	    out=$$run/clustering $(HELD_OUT) && \
	  $(RUN) -m most.evaluate predictions=$$run/clustering out=$$run/evaluated/clustering.json $(HELD_OUT) || exit; done
	$(RUN) -m most.report runs=$(SWEPT) out=$(ABLATION)/report_$(SIZE)

# Real scans, where there are any: MOST_REAL_DATA=FOLDER make test (FOLDER holds semantickitti/sequences/NN and nuscenes).
test: setup
	OMP_NUM_THREADS=1 $(RUN) -m pytest -n 2 --dist worksteal --jaxtyping-packages=most,shapes.checked

lint: setup
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy

bench: setup
	$(RUN) benchmarks/sparse.py
	$(RUN) benchmarks/network.py

clean:
	rm -rf $(VENV) $(DEVKIT) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis

distclean: clean
	rm -rf $(DEMO) $(VELOCITY) $(ABLATION)
