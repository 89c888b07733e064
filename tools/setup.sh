#!/usr/bin/env bash
# Prepares .venv and builds Goshawk into it. Run by every make target; does only what is not done yet.
#   tools/setup.sh          what the demo and the commands need
#   tools/setup.sh browser  also Chromium, for the tests of the web page
#   tools/setup.sh slow     also what the slow tests need: ARM compiler and emulator, clang 19, cppcheck, Betaflight's SITL
set -euo pipefail
cd "$(dirname "$0")/.."
say() { printf '\033[1m[setup]\033[0m %s\n' "$*"; }
source tools/again.sh

python=""
for candidate in python3.13 python3.12 python3.11 python3; do
  if command -v "$candidate" >/dev/null && "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    python=$candidate && break
  fi
done
[ -n "$python" ] || { say "Python 3.11 or newer is needed and none was found"; exit 1; }

# Debian packages: shared libraries that wheels expect of the system, a compiler, and (for tests) a browser.
wanted=(libusb-1.0-0 libgl1 libegl1 libgomp1 libx11-6)
command -v c++ >/dev/null || wanted+=(build-essential)
"$python" -c 'import ensurepip' 2>/dev/null || wanted+=(python3-venv)
[ -f "$("$python" -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h" ] || wanted+=(python3-dev)
case "${1:-}" in browser | slow) command -v chromium >/dev/null || wanted+=(chromium) ;; esac
if [ "${1:-}" = slow ]; then
  wanted+=(gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm clang-19 llvm-19 libclang-rt-19-dev cppcheck)
fi
if command -v dpkg-query >/dev/null; then
  missing=()
  for package in "${wanted[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
  done
  if [ ${#missing[@]} -gt 0 ]; then
    if [ "$(id -u)" = 0 ]; then
      say "installing Debian packages: ${missing[*]}"
      export DEBIAN_FRONTEND=noninteractive
      # Without the error mode, apt-get update calls lists that it could not fetch a success.
      AGAIN_TRIES=6 again "apt-get update" apt-get -o APT::Update::Error-Mode=any update -qq ||
        say "going on with the package lists that are here"
      again "apt-get install" apt-get -o DPkg::Lock::Timeout=60 -o Acquire::Retries=3 \
        install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
    else
      say "these Debian packages are missing; install them, then run this again:"
      say "  sudo apt-get install --no-install-recommends ${missing[*]}"
      exit 1
    fi
  fi
fi

if [ ! -x .venv/bin/uv ]; then
  say "making .venv with $("$python" --version)"
  "$python" -m venv .venv
  again "installing uv" \
    .venv/bin/pip install --quiet --disable-pip-version-check "$(grep -oE '^uv==[^ ;]+' requirements.lock)"
fi
if ! cmp -s requirements.lock .venv/installed.lock; then
  say "installing $(grep -cE '^[a-z0-9]' requirements.lock) Python packages, as pinned in requirements.lock"
  again "installing the Python packages" .venv/bin/uv pip sync --quiet --python .venv/bin/python requirements.lock
  cp requirements.lock .venv/installed.lock
  rm -f .venv/built.stamp
fi

# Goshawk is built again when a native source is newer than the last build, or a Python file came or went.
native_sources() {
  find pyproject.toml CMakeLists.txt flight esdf vehicle mapping planner sysid firmware_bridge preflight goshawk -type f \
    \( -name '*.c' -o -name '*.h' -o -name '*.cpp' -o -name '*.hpp' -o -name CMakeLists.txt -o -name pyproject.toml \) "$@"
}
# An editable install knows each Python file by its name: one that came or went needs a new install, too.
modules() { find flight esdf vehicle mapping planner sysid firmware_bridge preflight gcs_web goshawk -name '*.py' | sort; }
if [ ! -f .venv/built.stamp ] || [ -n "$(native_sources -newer .venv/built.stamp -print -quit)" ] ||
  ! modules | cmp -s - .venv/built.modules; then
  say "building Goshawk (the C and C++ parts take about a minute)"
  touch .venv/building.stamp
  PATH="$PWD/.venv/bin:$PATH" .venv/bin/uv pip install --quiet --python .venv/bin/python \
    --no-deps --no-build-isolation --reinstall-package goshawk -e .
  modules > .venv/built.modules
  mv .venv/building.stamp .venv/built.stamp
fi

# Betaflight for its tests, into the user's cache; they are skipped, and say why, where it cannot be had.
if [ "${1:-}" = slow ]; then
  AGAIN_TRIES=3 again "fetching and building Betaflight's SITL" \
    .venv/bin/python -m firmware_bridge.betaflight_sitl.firmware || say "going on without Betaflight"
fi
