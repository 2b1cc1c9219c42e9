#!/bin/sh
# Builds a program that needs no file of the system, and tries it in a folder that has nothing else (as root: chroot).
#   tools/packaging/static.sh [TARGET]      x86_64-unknown-linux-gnu (default) or x86_64-unknown-linux-musl
set -eu
cd "$(dirname "$0")/../.."

target=${1:-x86_64-unknown-linux-gnu}
folder=${CARGO_TARGET_DIR:-target}
RUSTFLAGS="${RUSTFLAGS:-} -C target-feature=+crt-static" cargo build --release --bin oscura --target "$target"
program=$folder/$target/release/oscura

if readelf -d "$program" | grep NEEDED; then
    echo "$program needs the libraries above" >&2
    exit 1
fi
if [ "$(id -u)" != 0 ]; then
    echo "not tried in an empty folder: that takes root"
    exit 0
fi
empty=$(mktemp -d)
trap 'rm -rf "$empty"' EXIT
cp "$program" assets/cornell-box.gltf "$empty/"
chroot=$(PATH=$PATH:/usr/sbin; command -v chroot)
inside() { env -i "$chroot" "$empty" /oscura "$@"; }
inside --version
inside render /cornell-box.gltf -o /a.png -o /a.exr --width 64 --spp 4 --denoise
inside inspect /cornell-box.gltf > /dev/null
inside info /a.exr > /dev/null
inside thumb /cornell-box.gltf --size 32
test -s "$empty/a.png" && test -s "$empty/cornell-box.png"
echo "$program runs in an empty folder"
