#!/bin/sh
# Lays a built program out as packages have it: the program, manual pages, completions, the thumbnailer of file managers, licences.
#   [DESTDIR=folder] [PREFIX=/usr] tools/packaging/install.sh target/release/oscura
set -eu

program=${1:?the built program, such as target/release/oscura}
case $program in */*) ;; *) program=./$program ;; esac
prefix=${PREFIX:-/usr/local}
share=${DESTDIR:-}$prefix/share
sources=$(dirname "$0")/../..

install -Dm755 "$program" "${DESTDIR:-}$prefix/bin/oscura"

mkdir -p "$share/man/man1"
"$program" man > "$share/man/man1/oscura.1"
# The program stands on no left side of a pipe: its failures there would be lost.
help=$("$program" --help)
commands=$(printf '%s\n' "$help" | awk '/^Commands:/ { on = 1; next } /^$/ { on = 0 } on && /^  [a-z]/ { print $1 }')
for command in ${commands:?no commands in the help of the program}; do
    "$program" man "$command" > "$share/man/man1/oscura-$command.1"
done

completions() {
    mkdir -p "$share/$2"
    "$program" completions "$1" > "$share/$2/$3"
}
completions bash bash-completion/completions oscura
completions fish fish/vendor_completions.d oscura.fish
completions zsh zsh/site-functions _oscura

# The system's own step after installing, update-mime-database, is the package manager's.
mkdir -p "$share/thumbnailers" "$share/mime/packages"
files=$("$program" install-thumbnailer --print)
printf '%s\n' "$files" | awk -v share="$share" -v program="$prefix/bin/oscura" '
    /^# .*\/thumbnailers\// { file = share "/thumbnailers/oscura.thumbnailer"; next }
    /^# .*\/mime\// { file = share "/mime/packages/oscura.xml"; next }
    /^TryExec=/ { $0 = "TryExec=" program }
    /^Exec=/ { sub(/"[^"]*"/, "\"" program "\"") }
    NF { print > file }'
for file in thumbnailers/oscura.thumbnailer mime/packages/oscura.xml; do
    [ -s "$share/$file" ] || { echo "install.sh: $file was not made" >&2; exit 1; }
done

for name in LICENSE-APACHE LICENSE-MIT README.md CHANGELOG.md; do
    install -Dm644 "$sources/$name" "$share/doc/oscura/$name"
done
