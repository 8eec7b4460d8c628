#!/bin/sh
# Usage: setup/version.sh 0.3.0   Write a version into VERSION, CITATION.cff and the manifests, which bloom and colcon read.
set -eu
cd "$(dirname "$0")/.."
echo "$1" > VERSION
sed -i "s#<version>.*</version>#<version>$1</version>#" src/*/package.xml
sed -i "s/^version = .*/version = $1/" src/*/setup.cfg
sed -i "s/^__version__ = .*/__version__ = \"$1\"/" src/hindrax_bag/hindrax_bag/__init__.py
sed -i "s/^version: .*/version: $1/" CITATION.cff
sed -i "s/^LABEL version=.*/LABEL version=\"$1\"/" docker/blueos/Dockerfile
sed -i "s/hindrax-blueos:[0-9.]*/hindrax-blueos:$1/" docker/blueos/bake.json
sed -i "s/^    \"version\": \".*\"/    \"version\": \"$1\"/" src/hindrax_operator/hindrax_operator/web/http_server.py
