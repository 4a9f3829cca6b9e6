#!/usr/bin/env bash
# Installs everything that fdi_lio needs to build, run and test.
#   Debian 12 (bookworm): ROS 1 comes from Debian itself (tested).
#   Ubuntu 20.04 with ROS Noetic: dependencies by rosdep (written with care, NOT tested here).
set -euo pipefail

here="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

debian_packages=(
  # build tools
  build-essential cmake ccache pkg-config git clang-format clang-tidy catkin catkin-lint
  # ROS 1
  ros-base-dev ros-std-msgs ros-sensor-msgs ros-nav-msgs ros-geometry-msgs
  librosbag-dev libroscpp-dev libmessage-filters-dev libtf2-ros-dev libtf2-eigen-dev libtopic-tools-dev
  libnodeletlib-dev libnodelet-dev libnodeletlib-tools pluginlib-dev
  libdiagnostic-updater-dev libdiagnostic-msgs-dev
  librostest-dev python3-rostest python3-roslaunch
  python3-std-msgs python3-std-srvs python3-geometry-msgs python3-nav-msgs python3-sensor-msgs python3-diagnostic-msgs
  python3-rosbag python3-rosgraph python3-rospy python3-rosnode python3-rostopic python3-tf2-ros rosout
  libvisualization-msgs-dev ros-visualization-msgs librviz-dev rviz
  libpcl-ros-dev libpcl-conversions-dev libpcl-dev
  # numerics
  libeigen3-dev libceres-dev libyaml-cpp-dev libtbb-dev libgeographiclib-dev libembree-dev libopencv-dev
  # tests
  libgtest-dev libgmock-dev libbenchmark-dev
  # scripts and pictures
  python3-numpy python3-matplotlib python3-yaml python3-pytest xvfb libgl1-mesa-dri xauth imagemagick x11-utils
)

as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }

install_debian() {
  export DEBIAN_FRONTEND=noninteractive
  local missing=()
  for package in "${debian_packages[@]}"; do
    dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$' || missing+=("$package")
  done
  if [ "${#missing[@]}" -eq 0 ]; then
    echo "setup: all ${#debian_packages[@]} packages are installed"
    return
  fi
  echo "setup: installing ${#missing[@]} packages: ${missing[*]}"
  as_root apt-get update -q
  as_root apt-get install -q -y --no-install-recommends "${missing[@]}"
}

install_noetic() {
  if [ ! -d /opt/ros/noetic ]; then
    echo "setup: Ubuntu 20.04 needs ROS Noetic in /opt/ros/noetic first: http://wiki.ros.org/noetic/Installation/Ubuntu" >&2
    exit 1
  fi
  as_root apt-get update -q
  as_root apt-get install -q -y python3-rosdep python3-catkin-lint clang-format ccache xvfb imagemagick
  [ -e /etc/ros/rosdep/sources.list.d/20-default.list ] || as_root rosdep init
  rosdep update
  rosdep install --from-paths "$here" --ignore-src --rosdistro noetic -y
}

# roslaunch and the nodes look up localhost; a bare chroot or container may have no /etc/hosts.
name_localhost() {
  if getent hosts localhost >/dev/null; then return; fi
  echo "setup: localhost has no address, and ROS needs one: adding 127.0.0.1 to /etc/hosts"
  echo "127.0.0.1 localhost" | as_root tee -a /etc/hosts >/dev/null
}

# shellcheck disable=SC1091
. /etc/os-release
case "${ID}:${VERSION_ID:-}" in
  debian:12) install_debian ;;
  ubuntu:20.04) install_noetic ;;
  *)
    echo "setup: ${PRETTY_NAME:-this system} is not supported: use Debian 12, or Ubuntu 20.04 with ROS Noetic" >&2
    exit 1
    ;;
esac
name_localhost
