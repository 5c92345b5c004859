# SPDX-FileCopyrightText: hapode contributors
# SPDX-License-Identifier: MIT
# Completion of hapode-run, hapode-bench and spidar-emulator for bash. The programs themselves say
# what there is, so that this file names no option but those that take a file.

# _hapode_section PROGRAM HEADING: the names in that part of what --list prints.
_hapode_section() {
  "$1" --list 2>/dev/null | awk -v heading="$2" '
    /^[a-z]/ { inside = index($0, heading) == 1; next }
    inside && /^  [a-z]/ { sub(/\[.*/, "", $1); print $1 }'
}

_hapode_options() {
  "$1" --help 2>/dev/null | grep -oE -- '--[a-z][a-z-]*' | sort -u
}

_hapode() {
  local program=$1 word=$2 before=$3 words=""
  COMPREPLY=()
  case ${program##*/} in
    hapode-run | hapode-view)
      case $before in
        --scene) words=$(_hapode_section "$program" scenes) ;;
        --model) words=$(_hapode_section "$program" models) ;;
        --device | --check-device) words=$(_hapode_section "$program" devices) ;;
        --identity | --identify | --calibrate | --trace | --plot | --html | --shot | \
          --frames | \
          --black-box | --record | --play | --play-incomplete | --certificates)
          mapfile -t COMPREPLY < <(compgen -f -- "$word")
          return ;;
        *) words=$(_hapode_options "$program") ;;
      esac ;;
    hapode-bench)
      case $before in
        --out | --merge) mapfile -t COMPREPLY < <(compgen -f -- "$word") && return ;;
        "$program") words=$("$program" --help 2>/dev/null | awk '/^  [a-z]/ { print $1 }') ;;
        *) words=$(_hapode_options "$program") ;;
      esac ;;
    *) words=$(_hapode_options "$program") ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")
}

complete -o filenames -F _hapode hapode-run hapode-view hapode-bench spidar-emulator
