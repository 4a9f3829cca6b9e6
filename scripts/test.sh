#!/usr/bin/env bash
# Installs dependencies, builds, and runs every test.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
export PATH="/usr/bin:$PATH"
"$here/scripts/setup.sh"
"$here/scripts/build.sh"
build_dir="${FDI_LIO_BUILD_DIR:-$here/build}"

echo "== format"
mapfile -t sources < <(git -C "$here" ls-files '*.cpp' '*.hpp' | sed "s|^|$here/|")
clang-format --dry-run --Werror "${sources[@]}"
echo "== catkin_lint"
# The folder of a checkout may have any name.
catkin_lint -q --offline --strict -W2 --ignore package_path_name "$here"
echo "== tests of the scripts"
/usr/bin/python3 -m pytest -q "$here/test/scripts"
echo "== tests"
ctest --test-dir "$build_dir" --output-on-failure
