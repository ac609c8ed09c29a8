#!/bin/sh
# Runs as root in a root with systemd, beside the package and the updates: what is done to a box, what is said, and what is so. One line
# for each step: `NAME|exit code|what the program printed, in one line|state of the unit|version that runs|answer of the page`.
cd /trial || exit 1
home=/usr/lib/cnc-gateway
data=/var/lib/cnc-gateway
key=versions.pub

runs() {
  process=$(systemctl show -p MainPID --value cnc-gateway)
  [ "$process" = 0 ] || basename "$(dirname "$(readlink "/proc/$process/exe")")"
}
page() { curl -s -m 3 -o /dev/null -w '%{http_code}' http://127.0.0.1:8080/healthz; }
note() { # NAME CODE, what was printed in ./said
  echo "$1|$2|$(tr '\n|' '  ' < said)|$(systemctl is-active cnc-gateway)|$(runs)|$(page)" >> steps
}
update() { # NAME ARGUMENT...
  name=$1
  shift
  cnc-gateway update "$@" > said 2>&1
  note "$name" $?
}
mode() { echo "$2" > "$data/mode-$1"; }
settle() { # waits until the unit is active and the page answers
  for _ in $(seq 120); do
    if [ "$(systemctl is-active cnc-gateway)" = active ] && [ "$(page)" = 200 ]; then break; fi
    sleep 1
  done
  : > said
}

rm -f steps done
dpkg -i package.deb > said 2>&1
code=$?
settle
note install $code
journalctl -u cnc-gateway --no-pager > journal-install
cnc-gateway person list > said 2>&1
note person-list $?
cnc-gateway person token admin > said 2>&1
note person-token $?
stat -c %U "$data/persons.json" > said
note owner-of-persons $?
for number in 1 2 3; do
  systemctl restart cnc-gateway
  settle
  note restart-$number 0
done
for number in 1 2 3 4 5 6 7 8; do
  # While the guard waits there is no process.
  process=$(systemctl show -p MainPID --value cnc-gateway)
  [ "$process" = 0 ] || kill -KILL "$process"
  sleep 2.5
done
settle
note killed-eight-times 0
mode 0.2.0 crash
update bad-first cnc-gateway-0.2.0.tar.gz --verify $key
update bad-again cnc-gateway-0.2.0.tar.gz --verify $key
update bad-third cnc-gateway-0.2.0.tar.gz --verify $key
mode 0.2.0 hang
(timeout -s KILL 6 cnc-gateway update cnc-gateway-0.2.0.tar.gz > /dev/null 2>&1)
mode 0.3.0 crash
update bad-on-killed cnc-gateway-0.3.0.tar.gz
# The disk of the versions is full while a trial is under way.
mode 0.2.0 hang
mount -t tmpfs -o size=400m none /mnt && cp -a $home/. /mnt/ && mount --bind /mnt $home
(timeout -s KILL 6 cnc-gateway update cnc-gateway-0.2.0.tar.gz > /dev/null 2>&1)
dd if=/dev/zero of=$home/filler bs=1M > /dev/null 2>&1
dd if=/dev/zero of=$home/filler2 bs=512 > /dev/null 2>&1
mode 0.2.0 crash
for _ in 1 2 3 4; do
  systemctl kill -s KILL cnc-gateway
  sleep 4
done
settle
note full-disk 0
rm -f $home/filler $home/filler2
mode 0.2.0 good
update good cnc-gateway-0.2.0.tar.gz
update other-key cnc-gateway-0.4.0-other-key.tar.gz --verify other.pub
update older cnc-gateway-0.0.9.tar.gz
update report
echo done > done
systemctl poweroff
