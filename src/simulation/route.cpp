#include "fdi_lio/simulation/route.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {

namespace {

/// Standard deviation of the smoothing that turns jumps of the curvature into ramps, metres; small in narrow
/// bends, so that the way keeps clear of the inner corner.
double smoothing_of(double radius) { return std::clamp(0.25 * radius, 0.25, 2.5); }

/// Polyline with arcs at the corners.
std::vector<Eigen::Vector2d> rounded(const std::vector<Eigen::Vector2d>& corners, double radius, bool closed,
                                     double spacing) {
  const std::size_t n = corners.size();
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < n; ++i) {
    if (!closed && (i == 0 || i + 1 == n)) {
      points.push_back(corners[i]);
      continue;
    }
    const Eigen::Vector2d to_previous = corners[(i + n - 1) % n] - corners[i];
    const Eigen::Vector2d to_next = corners[(i + 1) % n] - corners[i];
    const Eigen::Vector2d a = to_previous.normalized();
    const Eigen::Vector2d b = to_next.normalized();
    const double half_angle = 0.5 * std::acos(std::clamp(a.dot(b), -1.0, 1.0));
    const double cut =
        std::min(radius / std::tan(half_angle), 0.45 * std::min(to_previous.norm(), to_next.norm()));
    const double fitted = cut * std::tan(half_angle);
    const Eigen::Vector2d centre = corners[i] + (a + b).normalized() * (cut / std::cos(half_angle));
    const Eigen::Vector2d first = corners[i] + cut * a - centre;
    const double sweep = (M_PI - 2.0 * half_angle) * (a.x() * b.y() - a.y() * b.x() > 0.0 ? -1.0 : 1.0);
    const int steps = std::max(2, static_cast<int>(std::ceil(std::abs(sweep) * fitted / spacing)));
    for (int k = 0; k <= steps; ++k) {
      points.push_back(centre + Eigen::Rotation2Dd(sweep * k / steps) * first);
    }
  }
  if (closed) points.push_back(points.front());
  return points;
}

/// Points at equal distances along a polyline, at most `spacing` apart; sets it to the distance used.
std::vector<Eigen::Vector2d> resampled(const std::vector<Eigen::Vector2d>& points, std::size_t* intervals,
                                       double* spacing) {
  std::vector<double> lengths{0.0};
  for (std::size_t i = 1; i < points.size(); ++i) {
    lengths.push_back(lengths.back() + (points[i] - points[i - 1]).norm());
  }
  *intervals = static_cast<std::size_t>(std::ceil(lengths.back() / *spacing));
  *spacing = lengths.back() / static_cast<double>(*intervals);
  std::vector<Eigen::Vector2d> result;
  std::size_t segment = 1;
  for (std::size_t i = 0; i <= *intervals; ++i) {
    const double s = *spacing * static_cast<double>(i);
    while (segment + 1 < points.size() && lengths[segment] < s) ++segment;
    const double span = lengths[segment] - lengths[segment - 1];
    const double u = span > 0.0 ? std::clamp((s - lengths[segment - 1]) / span, 0.0, 1.0) : 0.0;
    result.push_back(points[segment - 1] + u * (points[segment] - points[segment - 1]));
  }
  return result;
}

std::vector<Eigen::Vector2d> smoothed(const std::vector<Eigen::Vector2d>& points, double spacing,
                                      double sigma, bool closed) {
  const int reach = static_cast<int>(std::ceil(3.0 * sigma / spacing));
  const int n = static_cast<int>(points.size()) - (closed ? 1 : 0);
  const auto point = [&](int i) -> Eigen::Vector2d {
    if (closed) return points[static_cast<std::size_t>((i % n + n) % n)];
    // Reflect at the ends, so that the ends stay where they are.
    if (i < 0) return 2.0 * points.front() - points[static_cast<std::size_t>(std::min(-i, n - 1))];
    if (i >= n) return 2.0 * points.back() - points[static_cast<std::size_t>(std::max(2 * (n - 1) - i, 0))];
    return points[static_cast<std::size_t>(i)];
  };
  std::vector<Eigen::Vector2d> result;
  for (int i = 0; i < static_cast<int>(points.size()); ++i) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double total = 0.0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = std::exp(-0.5 * std::pow(k * spacing / sigma, 2));
      sum += weight * point(i + k);
      total += weight;
    }
    result.push_back(sum / total);
  }
  return result;
}

double wrapped(double angle) { return std::remainder(angle, 2.0 * M_PI); }

}  // namespace

Route::Route(const std::vector<Eigen::Vector2d>& corners, double radius, bool closed) : closed_(closed) {
  if (corners.size() < (closed ? 3u : 2u)) throw Error("a route needs at least two corners, a loop three");
  const double sigma = smoothing_of(radius);
  spacing_ = std::min(0.5, 0.3 * sigma);
  const std::vector<Eigen::Vector2d> way = rounded(corners, radius, closed, spacing_);
  const std::vector<Eigen::Vector2d> even = resampled(way, &count_, &spacing_);
  positions_ = smoothed(even, spacing_, sigma, closed);
  headings_.resize(count_ + 1);
  for (std::size_t i = 0; i <= count_; ++i) {
    const std::size_t before = i > 0 ? i - 1 : (closed ? count_ - 1 : 0);
    const std::size_t after = i < count_ ? i + 1 : (closed ? 1 : count_);
    const Eigen::Vector2d tangent = positions_[after] - positions_[before];
    const double heading = std::atan2(tangent.y(), tangent.x());
    headings_[i] = i == 0 ? heading : headings_[i - 1] + wrapped(heading - headings_[i - 1]);
  }
  turn_ = closed ? headings_[count_] - headings_[0] : 0.0;
  curvatures_.resize(count_ + 1);
  for (std::size_t i = 0; i < count_; ++i) curvatures_[i] = (headings_[i + 1] - headings_[i]) / spacing_;
  curvatures_[count_] = closed ? curvatures_[0] : 0.0;
}

Route::Point Route::at(double s) const {
  const double limit = length();
  double laps = 0.0;
  if (closed_) {
    laps = std::floor(s / limit);
    s -= laps * limit;
  }
  s = std::clamp(s, 0.0, limit);
  const std::size_t i = std::min(static_cast<std::size_t>(s / spacing_), count_ - 1);
  const double u = s / spacing_ - static_cast<double>(i);
  Point point;
  // Hermite: straight pieces between the points would be jolts.
  const auto tangent = [&](std::size_t k) {
    return Eigen::Vector2d(spacing_ * std::cos(headings_[k]), spacing_ * std::sin(headings_[k]));
  };
  const double u2 = u * u, u3 = u2 * u;
  point.position = (2.0 * u3 - 3.0 * u2 + 1.0) * positions_[i] + (u3 - 2.0 * u2 + u) * tangent(i) +
                   (3.0 * u2 - 2.0 * u3) * positions_[i + 1] + (u3 - u2) * tangent(i + 1);
  point.heading = (1.0 - u) * headings_[i] + u * headings_[i + 1] + laps * turn_;
  point.curvature = (1.0 - u) * curvatures_[i] + u * curvatures_[i + 1];
  return point;
}

}  // namespace fdi_lio::simulation
