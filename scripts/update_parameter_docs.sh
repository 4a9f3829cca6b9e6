#!/usr/bin/env bash
# Writes docs/parameters.md from the declaration of the parameters.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
build_dir="${FDI_LIO_BUILD_DIR:-$here/build}"
cmake --build "$build_dir" --target parameter_table
table="$(find "$build_dir" -name parameter_table -type f -perm -u+x | head -n 1)"
{
  printf '# Parameters\n\nWritten by `scripts/update_parameter_docs.sh` from the declaration; a test compares the two.\n\n'
  "$table"
} > "$here/docs/parameters.md"
