#!/usr/bin/env bash
# Installs dependencies, builds, simulates a 60 s drive through a street and a tunnel, runs the nodes on it, and judges
# the result. usage: scripts/demo.sh [--rviz] [--output DIR]    (out/demo by default)
#
# The recording is simulated once and kept; each run gets a folder of its own, nothing is overwritten.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
export PATH="/usr/bin:$PATH"

rviz=false
out="$here/out/demo"
while [ $# -gt 0 ]; do
  case "$1" in
    --rviz) rviz=true ;;
    --output)
      [ $# -ge 2 ] || { echo "demo: --output needs a folder" >&2; exit 2; }
      mkdir -p "$2"
      out="$(cd "$2" && pwd)"
      shift
      ;;
    *) echo "demo: unknown argument '$1'; usage: scripts/demo.sh [--rviz] [--output DIR]" >&2; exit 2 ;;
  esac
  shift
done
if [ "$rviz" = true ] && [ -z "${DISPLAY:-}" ]; then
  echo "demo: --rviz needs a screen, and DISPLAY is not set: leave --rviz out, or use xvfb-run -a scripts/demo.sh --rviz" >&2
  exit 2
fi

"$here/scripts/setup.sh"
"$here/scripts/build.sh"
build_dir="${FDI_LIO_BUILD_DIR:-$here/build}"
seconds_of_build=$SECONDS

recording="$out/recording/street_tunnel.bag"
truth="${recording%.bag}.tum"
config="${recording%.bag}.config.yaml"
if [ -f "$recording" ]; then
  echo "== the recording exists: $recording (delete its folder to simulate it again)"
else
  echo "== simulating 60 s of an HDL-64E with an IMU (about 1.5 GB)"
  mkdir -p "$out/recording"
  "$build_dir/devel/lib/fdi_lio/simulate_bag" --scenario "$here/config/scenarios/street_tunnel.yaml" --seed 1 \
    --duration 60 --output "$recording"
fi

number=1
while [ -e "$out/run_$number" ]; do number=$((number + 1)); done
run="$out/run_$number"
mkdir -p "$run"

echo "== running the five nodes, at the speed of the recording"
# A master of its own: whatever runs on this machine is left alone.
port="$(/usr/bin/python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')"
# A busy machine gets late, but drops nothing: waiting does no harm to a recording.
patience="nodes.answer_timeout=10 nodes.scan_queue=300"
ROS_MASTER_URI="http://127.0.0.1:$port" ROS_HOSTNAME=127.0.0.1 \
  "$build_dir/devel/env.sh" roslaunch -p "$port" fdi_lio fdi_lio.launch config:="$config" bag:="$recording" \
  set:="$patience" output:="$run" rviz:="$rviz" exit_at_end:=true
[ -f "$run/trajectory.tum" ] || { echo "demo: the nodes left no trajectory in $run" >&2; exit 1; }

echo "== comparing with the truth"
"$here/scripts/evaluate_trajectory.py" "$run/trajectory.tum" "$truth" --interpolate --plots "$run/plots" \
  --degeneracy "$run/degeneracy.csv" | tee "$run/evaluation.txt"
"$here/scripts/report.py" "$run" --ground-truth "$truth" --title "demo, run $number"

cat <<END

demo: done, $((SECONDS - seconds_of_build)) s after the build.
  $run/report.html       everything on one page: open it in a browser
  $run/trajectory.tum    poses of the IMU in map
  $run/map.pcd           the map: pcl_viewer, CloudCompare
  $run/evaluation.txt    errors against $truth
  $recording
END
