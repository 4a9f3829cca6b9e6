#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

/// Height of the ground in map frame, metres.
using Ground = std::function<double(double x, double y)>;

/// A way through corner points with rounded corners, smoothed so that its curvature is continuous.
class Route {
 public:
  /// `corners` in map frame; a corner is rounded with `radius` or less where its sides are short. A closed
  /// route returns from the last corner to the first and may be followed for any number of laps.
  Route(const std::vector<Eigen::Vector2d>& corners, double radius, bool closed);

  struct Point {
    Eigen::Vector2d position;
    double heading = 0.0;    ///< continuous along the way, also over laps
    double curvature = 0.0;  ///< 1/m, left is positive
  };

  /// At arc length `s`, metres; an open route stands still beyond its ends.
  Point at(double s) const;

  double length() const { return spacing_ * static_cast<double>(count_); }
  bool closed() const { return closed_; }

 private:
  std::vector<Eigen::Vector2d> positions_;
  std::vector<double> headings_;
  std::vector<double> curvatures_;
  double spacing_ = 0.5;
  std::size_t count_ = 0;  ///< intervals
  double turn_ = 0.0;      ///< heading gained in a lap
  bool closed_ = false;
};

/// Arc length over time of a vehicle on `route` from s = `start`: stands, accelerates, brakes before bends.
/// One value every `period` seconds, at least until `duration`.
std::vector<double> plan_progress(const Route& route, const MotionSettings& motion, double start,
                                  double duration, double period);

/// The IMU in the hand of a person who walks along `route`: steps, sway, and rotations up to
/// `motion.shake_rad_s`.
Trajectory walk(const Route& route, const Ground& ground, const MotionSettings& motion, double start,
                double duration, std::uint64_t seed);

/// The IMU of a vehicle (or, for motion type handheld, a person, see `walk`) that follows `route` over
/// `ground`: heading along the way, pitch and roll with the ground, vibration that grows with speed. Covers
/// `duration` seconds and a little more.
Trajectory drive(const Route& route, const Ground& ground, const MotionSettings& motion, double start,
                 double duration, std::uint64_t seed);

}  // namespace fdi_lio::simulation
