#!/bin/sh
# A version for tests: it is as well as the file `mode-VERSION` of its data directory says.
version=@VERSION@
case "$1" in
  --version) echo "cnc-gateway $version"; exit 0 ;;
  check) exit 0 ;;
esac
data=$(printf '%s\n' "$@" | sed -n '/^--data-dir$/{n;p;}')
here=$(dirname "$(readlink -f "$0")")
# A process of its own, by which it is seen which version runs.
[ -x "$here/sleep" ] || cp "$(readlink -f "$(command -v sleep)")" "$here/sleep" 2> /dev/null
case "$(cat "$data/mode-$version" 2> /dev/null)" in
  crash) exit 1 ;;
  hang) ;;
  # The real program, where a root with systemd has put it.
  *) [ ! -x "/opt/versions/$version/cnc-gateway" ] || exec "/opt/versions/$version/cnc-gateway" "$@" ;;
esac
case "$(cat "$data/mode-$version" 2> /dev/null)" in
  hang) ;;
  late) (sleep 1; printf %s "$version" > "$data/confirmed.new"; mv "$data/confirmed.new" "$data/confirmed") & ;;
  *) (sleep 0.2; printf %s "$version" > "$data/confirmed.new"; mv "$data/confirmed.new" "$data/confirmed") & ;;
esac
[ ! -x "$here/sleep" ] || exec "$here/sleep" 1000
exec sleep 1000
