#!/usr/bin/env bash
# Usage: setup/release.sh [--tag]   Builds dist/ for the version in VERSION: wheel, site, example data, SHA256SUMS.
# With --tag the commit gets the tag vVERSION, once all of it is built. setup/version.sh writes the version beforehand.
set -euo pipefail
cd "$(dirname "$0")/.."
version=$(<VERSION)
name=hindrax-$version

refuse() {
  echo "release: $*" >&2
  exit 1
}

case ${1-} in '' | --tag) ;; *) echo "release: found $1, wanted nothing or --tag" >&2; exit 2 ;; esac
[ -z "$(git status --porcelain)" ] || refuse "the clone has changes; commit or remove them"
grep -q "^## $version (2[0-9-]*)$" CHANGELOG.md || refuse "CHANGELOG.md: wanted '## $version (DATE)' for this release"
grep -q "^version: $version$" CITATION.cff || refuse "CITATION.cff: wanted version: $version; run setup/version.sh $version"
[ -z "$(git tag --list "v$version")" ] || refuse "v$version is tagged already; setup/version.sh writes the next version"

# The same files give the same wheel: its times are those of the commit.
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct) && export SOURCE_DATE_EPOCH
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
./hindrax setup
rm -rf dist
mkdir dist
git archive HEAD | tar x -C "$work"
(cd "$work" && "$OLDPWD/.hindrax/env/bin/python" setup.py --quiet bdist_wheel --dist-dir "$OLDPWD/dist")
./hindrax reference --site --out "$work/$name-site"
./hindrax reference --example-data --out "$work/$name-example"
for part in site example; do
  tar --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 -C "$work" -czf "dist/$name-$part.tar.gz" "$name-$part"
done
(cd dist && sha256sum -- * > SHA256SUMS)
[ "${1-}" != --tag ] || git tag --annotate --message "hindrax $version" "v$version"
echo "dist:"
(cd dist && ls -1)
