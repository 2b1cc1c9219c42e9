#!/bin/sh
# Makes the files of a release from a built program, best the static one (tools/packaging/static.sh):
#   [MAINTAINER="Name <mail>"] [REPOSITORY=https://...] tools/packaging/release.sh PROGRAM FOLDER
# FOLDER gets a compressed archive for any Linux, a package for Debian and Ubuntu (with MAINTAINER, where dpkg-deb is installed), the sources of
# the last commit, with REPOSITORY a formula for Homebrew that takes them from its releases, a list of all components (CycloneDX) and the SHA-256
# sums of these. The same program gives the same bytes.
set -eu

program=${1:?the built program, such as target/x86_64-unknown-linux-gnu/release/oscura}
folder=${2:?the folder for the files of the release}
sources=$(cd "$(dirname "$0")/../.." && pwd)
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' "$sources/Cargo.toml")
machine=$(uname -m)
# Of all files in the packages: the time of the last commit.
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$sources" log -1 --format=%ct)}
export SOURCE_DATE_EPOCH

mkdir -p "$folder"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp "$program" "$work/oscura"
strip "$work/oscura"

name=oscura-$version-$machine-linux
DESTDIR=$work/$name PREFIX=/ "$sources/tools/packaging/install.sh" "$work/oscura"
# These name the place of the program: 'oscura install-thumbnailer' writes them.
rm -r "$work/$name/share/thumbnailers" "$work/$name/share/mime"
tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -C "$work" -cf "$work/archive.tar" "$name"
xz -c "-${XZ_LEVEL:-9}" "$work/archive.tar" > "$folder/$name.tar.xz"

if [ -n "${MAINTAINER:-}" ] && command -v dpkg-deb > /dev/null; then
    package=$work/package
    DESTDIR=$package PREFIX=/usr "$sources/tools/packaging/install.sh" "$work/oscura"
    # The licences are one file in packages of Debian; manual pages are compressed.
    cat "$sources/LICENSE-MIT" "$sources/LICENSE-APACHE" > "$package/usr/share/doc/oscura/copyright"
    gzip -9n "$package"/usr/share/man/man1/*.1
    architecture=$(dpkg --print-architecture)
    needs=$(readelf -d "$work/oscura" | grep -q NEEDED && echo "Depends: libc6, libgcc-s1" || true)
    mkdir "$package/DEBIAN"
    {
        printf 'Package: oscura\nVersion: %s\nArchitecture: %s\nMaintainer: %s\n' "$version" "$architecture" "$MAINTAINER"
        printf 'Section: graphics\nPriority: optional\nInstalled-Size: %s\n' "$(du -sk "$package/usr" | cut -f1)"
        [ -z "$needs" ] || echo "$needs"
        printf 'Recommends: shared-mime-info\nSuggests: blender, ffmpeg\n'
        printf 'Description: offline path tracer for glTF, OBJ, PLY and Blender scenes\n'
        printf ' Renders scenes with one command to EXR with passes for compositing, and to PNG.\n'
    } > "$package/DEBIAN/control"
    dpkg-deb --root-owner-group -Zxz "-z${XZ_LEVEL:-9}" --build "$package" "$folder/oscura_${version}_$architecture.deb" > /dev/null
fi

source=oscura-$version.tar.gz
git -C "$sources" archive --prefix="oscura-$version/" HEAD | gzip -9n > "$folder/$source"
if [ -n "${REPOSITORY:-}" ]; then
    sum=$(sha256sum "$folder/$source" | cut -d' ' -f1)
    sed -e "s|@URL@|$REPOSITORY/releases/download/v$version/$source|" -e "s|@REPOSITORY@|$REPOSITORY|" -e "s|@SHA256@|$sum|" \
        "$sources/tools/packaging/oscura.rb.in" > "$folder/oscura.rb"
fi

python3 "$sources/tools/packaging/components.py" > "$folder/oscura-$version.cdx.json"

cd "$folder"
rm -f SHA256SUMS
sha256sum -- * > "$work/sums"
mv "$work/sums" SHA256SUMS
ls -l
