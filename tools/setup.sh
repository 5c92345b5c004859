# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# Sourced by run-demo and run-tests: packages and build folder on Debian. Everything it says goes to
# stderr. HAPODE_MESON_OPTIONS: options for meson, such as "-Dwerror=true".

# shellcheck shell=bash
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
build=$root/build

say() {
  printf '%s\n' "$*" >&2
}

# gcc alone only recommends the C library's headers, so libc6-dev is named.
packages_needed=(gcc libc6-dev meson ninja-build pkg-config libode-dev libccd-dev
  zlib1g-dev)
# For hapode-run --view and --shot.
# shellcheck disable=SC2034
packages_view=(libglfw3-dev libepoxy-dev libegl-dev libgl1-mesa-dri libpng-dev)

# Whether a package, or the same thing from elsewhere, is there.
have_package() {
  case $(dpkg-query -W -f='${Status}' "$1" 2>/dev/null) in
    *' ok installed') return 0 ;;
  esac
  case $1 in
    meson) command -v meson >/dev/null ;;
    ninja-build) command -v ninja >/dev/null ;;
    pkg-config) command -v pkg-config >/dev/null ;;
    clang) command -v clang >/dev/null ;;
    clang-format) command -v clang-format-14 >/dev/null ;;
    clang-tidy-14 | cppcheck) command -v "$1" >/dev/null ;;
    abigail-tools) command -v abidiff >/dev/null ;;
    gnuplot-nox) command -v gnuplot >/dev/null ;;
    python3) command -v python3 >/dev/null ;;
    *) return 1 ;;
  esac
}

# missing_packages NAME...: those that are not there, one a line.
missing_packages() {
  local name
  for name in "$@"; do
    have_package "$name" || printf '%s\n' "$name"
  done
}

# install_packages NAME...: as root or by a sudo that asks nothing; fails otherwise.
install_packages() {
  local as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    sudo -n true 2>/dev/null || return 1
    as_root=(sudo -n)
  fi
  say "installing: $*"
  # an update that fails may still leave lists that are good enough
  "${as_root[@]}" apt-get update -qq >&2 </dev/null || say "apt-get update failed"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "$@" >&2 </dev/null
}

# need_packages OPTIONAL...: installs what is missing; ends the script when a needed one stays away.
need_packages() {
  local needed optional package
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    say "not a Debian: needs ${packages_needed[*]}, is better with $*"
    return 0
  fi
  mapfile -t needed < <(missing_packages "${packages_needed[@]}")
  mapfile -t optional < <(missing_packages "$@")
  if [ $((${#needed[@]} + ${#optional[@]})) -eq 0 ]; then
    return 0
  fi
  # a package that cannot be had must not take the others with it
  if ! install_packages "${needed[@]}" "${optional[@]}"; then
    for package in "${needed[@]}" "${optional[@]}"; do
      install_packages "$package" || true
    done
  fi
  mapfile -t needed < <(missing_packages "${packages_needed[@]}")
  mapfile -t optional < <(missing_packages "$@")
  if [ ${#needed[@]} -gt 0 ]; then
    say "packages are missing; type:"
    say "  sudo apt-get update && sudo apt-get install -y --no-install-recommends" \
      "${needed[*]} ${optional[*]}"
    exit 1
  fi
  if [ ${#optional[@]} -gt 0 ]; then
    say "going on without ${optional[*]}; to have them, type:"
    say "  sudo apt-get update && sudo apt-get install -y --no-install-recommends ${optional[*]}"
  fi
}

# watch LOG: how far a build is that writes to LOG, as long as this script lives.
watch() {
  local step
  while kill -0 $$ 2>/dev/null; do
    sleep 0.5
    step=$(grep -o '^\[[0-9]*/[0-9]*\]' "$1" | tail -n 1) || true
    printf '\r  %s' "$step" >&2
  done
}

# quietly LOG COMMAND...: the output goes to LOG, and to stderr when the command fails. A terminal
# sees how far it is.
quietly() {
  local log=$1 code=0 watcher=
  shift
  : >"$log"
  if [ -t 2 ]; then
    watch "$log" &
    watcher=$!
  fi
  "$@" >"$log" 2>&1 </dev/null || code=$?
  if [ -n "$watcher" ]; then
    kill "$watcher"
    wait "$watcher" 2>/dev/null || true # it was killed
    printf '\r\033[K' >&2
  fi
  if [ $code -ne 0 ]; then
    cat "$log" >&2
    say "failed: $* (log: $log)"
    return 1
  fi
}

# A build folder that meson can still use and that belongs to this source folder.
build_is_good() {
  [ -f "$build/build.ninja" ] &&
    grep -qsF "\"source\": \"$root\"" "$build/meson-info/meson-info.json" &&
    meson configure "$build" >/dev/null 2>&1 </dev/null
}

# build_all [TARGET...]: everything where none is named, else those that this build has.
build_all() {
  local options target targets=()
  read -ra options <<<"${HAPODE_MESON_OPTIONS:-}"
  mkdir -p "$build"
  if ! build_is_good; then
    say "setting up $build"
    rm -rf "$build/meson-private" "$build/meson-info" "$build/build.ninja"
    quietly "$build/setup.log" meson setup --buildtype=release "${options[@]}" "$build" "$root"
  elif [ ${#options[@]} -gt 0 ]; then
    quietly "$build/setup.log" meson configure "$build" "${options[@]}"
  fi
  for target in "$@"; do
    if grep -q "^build $target:" "$build/build.ninja"; then
      targets+=("$target")
    fi
  done
  say "building"
  quietly "$build/compile.log" meson compile -C "$build" "${targets[@]}"
}
