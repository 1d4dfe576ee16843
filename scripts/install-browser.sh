#!/usr/bin/env bash
# Install Chromium, in which the tests look at the HTML report (Debian, Ubuntu).
set -euo pipefail
command -v chromium >/dev/null && { echo "Chromium is there: $(command -v chromium)"; exit 0; }
as_root=()
[ "$(id -u)" -eq 0 ] || as_root=(sudo)
"${as_root[@]}" apt-get update -q
"${as_root[@]}" apt-get install -y -q --no-install-recommends chromium
