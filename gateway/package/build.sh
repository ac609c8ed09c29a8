#!/usr/bin/env bash
# Builds everything that is handed out: Debian packages for amd64 and arm64, and archives for update and for boxes without apt.
#   gateway/package/build.sh [OUT_DIR] [TARGET...]
# Needed: dpkg-deb, cargo-zigbuild and zig (pip install cargo-zigbuild ziglang). zig links against the C library of
# Debian 11, so that one program runs on every box since then. Two runs give the same bytes (SOURCE_DATE_EPOCH).
# With PROGRAM=FILE nothing is compiled, and the package holds that program: one target, for a try.
set -euo pipefail
cd "$(dirname "$0")/../.."
out=$(realpath -m "${1:-target/packages}")
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu)
glibc=2.31
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH CARGO_INCREMENTAL=0
# Paths of this computer are not in the program.
home=${CARGO_HOME:-$HOME/.cargo}
export RUSTFLAGS="--remap-path-prefix=$PWD=/build --remap-path-prefix=$home=/cargo ${RUSTFLAGS:-}"
mkdir -p "$out"

# Man pages and completions are the same for every processor; they come from a program for this computer.
make_package_files() {
  local program=${PROGRAM:-target/package-files/debug/cnc-gateway}
  [ -x "$program" ] || cargo build --locked --target-dir target/package-files --bin cnc-gateway
  rm -rf target/package/man target/package/completions
  "$program" package-files target/package
  gzip -9nf target/package/man/*
  gzip -9nc gateway/handbook/changelog.md > target/package/changelog.gz
  printf 'cnc-gateway (%s-1) stable; urgency=medium\n\n  * See changelog.gz.\n\n -- cnc-gateway maintainers <maintainers@cnc-gateway.example>  %s\n' \
    "$version" "$(date -uRd "@$SOURCE_DATE_EPOCH")" | gzip -9nc > target/package/changelog.Debian.gz
}

# The tree of files that a package holds, below a folder.
stage() {
  local program=$1 root=$2 doc=$2/usr/share/doc/cnc-gateway
  rm -rf "$root"
  install -Dm755 "$program" "$root/usr/lib/cnc-gateway/versions/package/cnc-gateway"
  install -Dm755 gateway/package/guard "$root/usr/lib/cnc-gateway/guard"
  install -Dm640 gateway/package/cnc-gateway.toml "$root/etc/cnc-gateway/cnc-gateway.toml"
  install -Dm644 gateway/package/cnc-gateway.service "$root/usr/lib/systemd/system/cnc-gateway.service"
  install -Dm644 gateway/package/sysusers.conf "$root/usr/lib/sysusers.d/cnc-gateway.conf"
  install -Dm644 gateway/package/70-cnc-gateway.rules "$root/usr/lib/udev/rules.d/70-cnc-gateway.rules"
  install -Dm644 -t "$root/usr/share/man/man1" target/package/man/*.gz
  install -Dm644 target/package/completions/cnc-gateway.bash "$root/usr/share/bash-completion/completions/cnc-gateway"
  install -Dm644 target/package/completions/_cnc-gateway "$root/usr/share/zsh/vendor-completions/_cnc-gateway"
  install -Dm644 target/package/completions/cnc-gateway.fish "$root/usr/share/fish/vendor_completions.d/cnc-gateway.fish"
  install -Dm644 -t "$doc" README.md gateway/package/debian/copyright target/package/changelog.gz target/package/changelog.Debian.gz
}

# The same with what the package manager needs, as a package.
make_deb() {
  local program=$1 architecture=$2 root=target/package/root
  stage "$program" "$root"
  install -d "$root/DEBIAN"
  local size_kb
  size_kb=$(du -sk --apparent-size "$root" | cut -f1)
  sed "s/@VERSION@/$version-1/; s/@ARCHITECTURE@/$architecture/; s/@SIZE_KB@/$size_kb/" gateway/package/debian/control > "$root/DEBIAN/control"
  install -m644 gateway/package/debian/conffiles "$root/DEBIAN/conffiles"
  install -m755 -t "$root/DEBIAN" gateway/package/debian/{postinst,prerm,postrm}
  (cd "$root" && find etc usr -type f -print0 | sort -z | xargs -0 md5sum > DEBIAN/md5sums)
  find "$root" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
  dpkg-deb --root-owner-group -Zxz -z${DEB_LEVEL:-6} --build "$root" "$out/cnc-gateway_$version-1_$architecture.deb"
}

make_archive() {
  tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner \
    -C "$(dirname "$1")" -cf - cnc-gateway | gzip -9n > "$out/cnc-gateway-$version-$2.tar.gz"
}

build_target() {
  local target=$1 folder=target/$1/dist processor=${1%%-*} architecture=amd64
  [ "$processor" = x86_64 ] || architecture=arm64
  cargo zigbuild --locked --profile dist --bin cnc-gateway --target "$target.$glibc"
  local tools=""
  [ "$target" = "$(rustc -vV | sed -n 's/host: //p')" ] || tools=${processor}-linux-gnu-
  # The symbols stay beside the package: a crash report is read with them.
  "${tools}objcopy" --only-keep-debug "$folder/cnc-gateway" "$out/cnc-gateway-$version-$processor.debug"
  "${tools}strip" --strip-all "$folder/cnc-gateway"
  make_deb "$folder/cnc-gateway" "$architecture"
  make_archive "$folder/cnc-gateway" "$processor"
}

make_package_files
if [ -n "${PROGRAM:-}" ]; then
  make_deb "$PROGRAM" "$(dpkg --print-architecture)"
  make_archive "$PROGRAM" "$(uname -m)"
else
  for target in "${targets[@]}"; do build_target "$target"; done
fi
(cd "$out" && sha256sum -- *.deb *.tar.gz > SHA256SUMS && cat SHA256SUMS)
