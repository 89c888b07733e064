# Sourced by tools/setup.sh: a command that may fail for a moment is tried again.
# Another program holds the package manager's lock, or the network hiccups: both pass by themselves within minutes.

# again WHAT COMMAND...: run the command until it succeeds, at most AGAIN_TRIES times (8), with growing pauses of
# AGAIN_PAUSE_S (2), twice that, ... up to a minute. Says what failed, and ends with the command's own exit code.
again() {
  local what="$1" tries="${AGAIN_TRIES:-8}" pause_s="${AGAIN_PAUSE_S:-2}" try code
  shift
  for ((try = 1; ; try++)); do
    code=0
    "$@" || code=$?
    [ "$code" = 0 ] && return 0
    if [ "$try" -ge "$tries" ]; then
      say "$what failed $try times; the reason is printed above; correct it and run this again" >&2
      return "$code"
    fi
    say "$what failed: another program may hold the lock, or the network may be away" >&2
    say "trying again in $pause_s s (try $((try + 1)) of $tries)" >&2
    sleep "$pause_s"
    pause_s=$((pause_s * 2 > 60 ? 60 : pause_s * 2))
  done
}
