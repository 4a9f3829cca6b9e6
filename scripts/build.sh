#!/usr/bin/env bash
# Builds into build/ (or $FDI_LIO_BUILD_DIR); further arguments go to cmake.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
# The ROS of the system needs the Python of the system.
export PATH="/usr/bin:$PATH"
[ -f /opt/ros/noetic/setup.bash ] && { set +u; source /opt/ros/noetic/setup.bash; set -u; }
build_dir="${FDI_LIO_BUILD_DIR:-$here/build}"
cmake -S "$here" -B "$build_dir" -DPYTHON_EXECUTABLE=/usr/bin/python3 "$@"
cmake --build "$build_dir" --parallel "$(nproc)"
