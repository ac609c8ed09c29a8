#!/usr/bin/env bash
# Builds everything that is handed out: Debian packages for amd64 and arm64, and archives for update and for boxes without apt.
#   gateway/package/build.sh [OUT_DIR] [TARGET...]
# Needed: cargo-deb, cargo-zigbuild and zig (pip install cargo-zigbuild ziglang). zig links against the C library of
# Debian 11, so that one program runs on every box since then. Two runs give the same bytes (SOURCE_DATE_EPOCH).
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
  [ -x target/package-files/debug/cnc-gateway ] || cargo build --locked --target-dir target/package-files --bin cnc-gateway
  rm -rf target/package/man target/package/completions
  target/package-files/debug/cnc-gateway package-files target/package
  gzip -9nf target/package/man/*
  gzip -9nc gateway/handbook/changelog.md > target/package/changelog.gz
}

build_target() {
  local target=$1 folder=target/$1/dist architecture=${1%%-*}
  cargo zigbuild --locked --profile dist --bin cnc-gateway --target "$target.$glibc"
  # The symbols stay beside the package: a crash report is read with them.
  objcopy --only-keep-debug "$folder/cnc-gateway" "$out/cnc-gateway-$version-$architecture.debug" 2>/dev/null ||
    "llvm-objcopy" --only-keep-debug "$folder/cnc-gateway" "$out/cnc-gateway-$version-$architecture.debug"
  local strip=strip
  [ "$target" = "$(rustc -vV | sed -n 's/host: //p')" ] || strip=${architecture}-linux-gnu-strip
  "$strip" --strip-all "$folder/cnc-gateway"
  cargo deb --no-build --no-strip --locked --profile dist --target "$target" --output "$out/"
  tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner \
    -C "$folder" -cf - cnc-gateway | gzip -9n > "$out/cnc-gateway-$version-$architecture.tar.gz"
}

make_package_files
for target in "${targets[@]}"; do build_target "$target"; done
(cd "$out" && sha256sum -- *.deb *.tar.gz > SHA256SUMS && cat SHA256SUMS)
