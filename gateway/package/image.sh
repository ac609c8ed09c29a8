#!/usr/bin/env bash
# An image for podman, docker or containerd, as a folder in the layout of the Open Container Initiative. No daemon takes part.
#   gateway/package/image.sh PACKAGE.deb [OUT_DIR]
# Needed: mmdebstrap and umoci (Debian packages), and root. The base is Debian 12 without a package manager; curl is in it for the
# health check, which the one who starts the container names (the layout has no place for it):
#   podman run -d --network host -v cnc:/var/lib/cnc-gateway -v ./cnc-gateway.toml:/etc/cnc-gateway/cnc-gateway.toml:ro \
#     --health-cmd 'curl -fs http://127.0.0.1:8080/healthz' --health-interval 30s --stop-timeout 30 oci:target/image:latest
# With the network of the computer it reaches controls and meters as a service does, and its page listens where the configuration says: an
# address that other computers reach needs TLS and tokens, here too.
set -euo pipefail
package=$(realpath "$1")
out=$(realpath -m "${2:-target/image}")
mirror=${DEBIAN_MIRROR:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# `extract` unpacks and runs no script of any package.
mmdebstrap --quiet --variant=extract --include=libc6,libgcc-s1,ca-certificates,tzdata,curl,coreutils,dash,base-files \
  bookworm "$work/root.tar" ${mirror:+"$mirror"}
if [ -e "$out" ] && [ ! -f "$out/oci-layout" ]; then
  echo "$out is there and is no image; name another folder" >&2
  exit 2
fi
rm -rf "$out"
umoci init --layout "$out"
umoci new --image "$out:latest"
umoci unpack --image "$out:latest" "$work/bundle"
root=$work/bundle/rootfs
tar -C "$root" -xf "$work/root.tar" --exclude='./dev/*' --exclude='./usr/share/doc/*' --exclude='./usr/share/man/*' \
  --exclude='./usr/share/locale/*' --exclude='./var/cache/*' --exclude='./var/lib/apt/*'
ln -sfn dash "$root/bin/sh"
# What the scripts of the packages would have made.
cat "$root"/usr/share/ca-certificates/mozilla/*.crt > "$root/etc/ssl/certs/ca-certificates.crt"
printf 'root:x:0:0::/:/bin/sh\ncnc-gateway:x:990:990::/var/lib/cnc-gateway:/bin/sh\n' > "$root/etc/passwd"
printf 'root:x:0:\ncnc-gateway:x:990:\n' > "$root/etc/group"
dpkg-deb -x "$package" "$root"
ln -sfn versions/package "$root/usr/lib/cnc-gateway/current"
install -d -o 990 -g 990 -m 750 "$root/var/lib/cnc-gateway"
chown -R 0:990 "$root/etc/cnc-gateway"
umoci repack --image "$out:latest" "$work/bundle"
umoci config --image "$out:latest" --config.user 990:990 --config.volume /var/lib/cnc-gateway \
  --config.entrypoint /usr/lib/cnc-gateway/current/cnc-gateway --config.cmd run \
  --config.cmd --config --config.cmd /etc/cnc-gateway/cnc-gateway.toml --config.cmd --data-dir --config.cmd /var/lib/cnc-gateway \
  --config.stopsignal SIGTERM
umoci gc --layout "$out"
du -sh "$out"
