#!/usr/bin/env bash
# The window of apso_track --live on a display of its own: it opens, holds and steps on keys, and stops the run.
# Skipped (77) without Xvfb or xdotool.
# usage: live.sh APSO_TRACK
set -uo pipefail
track=$1
command -v Xvfb >/dev/null && command -v xdotool >/dev/null || { echo "skipped: Xvfb or xdotool was not found"; exit 77; }
scratch=$(mktemp -d)
server=; program=
stop() {
  [ -z "$program" ] || kill "$program" 2>/dev/null
  [ -z "$server" ] || kill "$server" 2>/dev/null
  rm -rf "$scratch"
}
trap stop EXIT
fail() { echo "live.sh: $*" >&2; cat "$scratch/log" >&2; exit 1; }
rows() { cat "$scratch"/out/unfinished/frames.csv 2>/dev/null | wc -l; }
wait_for() {  # SECONDS CONDITION
  local n
  for ((n = 0; n < 20 * $1; ++n)); do eval "$2" && return 0; sleep 0.05; done
  return 1
}

touch "$scratch/log"
# -noreset: else the server starts anew when its last client leaves, and refuses whoever comes meanwhile (9 of 500 on a busy machine)
Xvfb -noreset -displayfd 3 -screen 0 1280x800x24 3>"$scratch/display" 2>"$scratch/xvfb.log" &
server=$!
wait_for 10 '[ -s "$scratch/display" ]' || { echo "skipped: Xvfb does not start"; cat "$scratch/xvfb.log"; exit 77; }
DISPLAY=:$(cat "$scratch/display")
export DISPLAY
unset WAYLAND_DISPLAY
# on a busy machine the display has a number before it answers
wait_for 10 'xdotool getdisplaygeometry >/dev/null 2>&1' || { echo "skipped: Xvfb does not answer"; cat "$scratch/xvfb.log"; exit 77; }

"$track" synthetic:static_static --quiet --live --output "$scratch/out" >"$scratch/log" 2>&1 &
program=$!
wait_for 10 'window=$(xdotool search --name "apso_track synthetic:static_static" 2>/dev/null | tail -1) && [ -n "$window" ]' || fail "no window"
press() { xdotool windowfocus "$window" key "$1"; }
wait_for 10 '[ "$(rows)" -ge 4 ]' || fail "the run does not go on"
press space
wait_for 10 'n=$(rows); sleep 0.6; [ "$n" -eq "$(rows)" ]' || fail "space does not hold the run"
held=$(rows)
press n
wait_for 10 '[ "$(rows)" -eq $((held + 1)) ]' || fail "n does not step"
press Right
wait_for 10 '[ "$(rows)" -eq $((held + 2)) ]' || fail "right does not step"
sleep 0.4
[ "$(rows)" -eq $((held + 2)) ] || fail "a step does not hold again"
press space
wait_for 10 '[ "$(rows)" -ge $((held + 4)) ]' || fail "space does not go on"
press q
wait "$program"
code=$?
program=
[ "$code" -eq 130 ] || fail "q ends the run with exit code $code, expected 130 as from SIGINT"
[ -s "$scratch/out/trajectory.txt" ] || fail "the results are not kept"
