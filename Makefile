# make setup   the virtual environment .venv; the command is then .venv/bin/motor-sysid
# make demo    the whole loop over real DDS: make demo ARGS="--hide coulomb_friction"
# make test    ruff, mypy and pytest;  make test-all adds the slow tests
# make lock    choose the versions anew (needs uv);  UPGRADE=--upgrade takes newer ones
#
# PY=/path/to/python chooses the interpreter (3.11 or 3.12) that .venv is made with.

VENV := .venv
# A sourced ROS 2 brings its own rclpy; the environment for it is another one.
KIND := $(or $(ROS_DISTRO),wheels)
READY := $(VENV)/.ready-$(KIND)
LOCK := uv pip compile setup.py --universal --generate-hashes --no-strip-extras --quiet $(UPGRADE) \
	--custom-compile-command "make lock" --extra test --extra dev

.PHONY: setup demo test test-all lint lock clean

setup: $(READY)

$(READY): requirements.lock requirements-jazzy.lock setup.py setup.cfg tools/make_env
	PY="$(PY)" tools/make_env $(VENV)

demo: setup
	$(VENV)/bin/motor-sysid demo $(ARGS)

lint: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy

test: lint
	$(VENV)/bin/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow" $(ARGS)

test-all: lint
	$(VENV)/bin/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder $(ARGS)

lock:
	$(LOCK) --python-version 3.11 --extra ros -o requirements.lock
	$(LOCK) --python-version 3.12 -c requirements-jazzy.in -o requirements-jazzy.lock

clean:
	rm -rf $(VENV) build install log *.egg-info .mypy_cache .pytest_cache .ruff_cache
