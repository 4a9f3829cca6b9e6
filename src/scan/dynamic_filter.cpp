#include "fdi_lio/scan/dynamic_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {

constexpr int kColumnStride = 2;    ///< every second column is looked at; the others follow their neighbour
constexpr float kMostSlope = 0.3F;  ///< of a surface that may be ground
constexpr double kRevisedM = 2.0;   ///< no prediction of one scan is as far off
/// What one of so many scans has seen where it is, and not moving, while none has looked through, is static;
/// the others are not asked about it. Most points are.
constexpr std::size_t kAskedFirst = 2;
/// Of the sensor, before something that drives ahead of it stands out [m].
constexpr float kLeastWay = 1.0F;
/// What drives ahead comes nearer, or gets away, by no more [m/s]: behind what moved farther stands a wall.
constexpr float kMostClosing = 5.0F;
/// An object takes in so many times the cells that were seen to move: what hides behind it grows no farther.
constexpr std::size_t kMostGrowth = 6;

/// What is below a moving point, nearer to its plumb line than this and no deeper, moves with it: where feet
/// and wheels touch the ground, no scan can have looked through them [m].
constexpr float kFootM = 0.2F;
constexpr float kFootDepthM = 0.4F;

/// Calls `use(k, ring, column, range)` for each of `points` that `image` looked towards: the cell,
/// and how far away the point would have been.
template <typename Use>
void look_up(const RangeImage& image, const Eigen::Isometry3f& T_image_points,
             const std::vector<Eigen::Vector3f>& points, const Use& use) {
  RangeImage::Directions seen;
  for (std::size_t first = 0; first < points.size(); first += RangeImage::Directions::kSize) {
    const auto size = std::min<std::size_t>(RangeImage::Directions::kSize, points.size() - first);
    for (std::size_t k = 0; k < size; ++k) seen.set(static_cast<int>(k), points[first + k]);
    image.look_at(T_image_points, &seen);
    for (std::size_t k = 0; k < size; ++k) {
      const auto at = static_cast<int>(k);
      if (seen.ring[at] >= 0) use(first + k, seen.ring[at], seen.column[at], seen.range_m[at]);
    }
  }
}

/// Groups cells of one image that touch. Cells are (ring, column / kColumnStride).
class ObjectGrower {
 public:
  ObjectGrower(const DeskewedScan& scan, const RangeImage& image, const DynamicConfig& config)
      : scan_(scan),
        image_(image),
        config_(config),
        columns_(image.columns() / kColumnStride),
        taken_(static_cast<std::size_t>(image.rings()) * static_cast<std::size_t>(columns_), 0) {}

  int columns() const { return columns_; }
  std::size_t cell(int ring, int column) const {
    const int wrapped = column < 0 ? column + columns_ : (column >= columns_ ? column - columns_ : column);
    return static_cast<std::size_t>(ring) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(wrapped);
  }
  /// The first point in the columns of the cell: deskewed for a world that stands, a car that drives along is
  /// pulled apart, and every other column is empty.
  std::uint32_t point_of(int ring, int column) const {
    std::uint32_t point = RangeImage::kNone;
    for (int step = 0; step < kColumnStride && point == RangeImage::kNone; ++step)
      point = image_.at(ring, column * kColumnStride + step);
    return point;
  }
  std::uint32_t point_of(std::size_t cell) const {
    const auto columns = static_cast<std::size_t>(columns_);
    return point_of(static_cast<int>(cell / columns), static_cast<int>(cell % columns));
  }

  /// The cells that `accept` and that touch `seed`, directly or through others; none if seed was taken.
  template <typename Accept>
  std::vector<std::size_t> grow(std::size_t seed, const Accept& accept) {
    std::vector<std::size_t> members;
    if (taken_[seed] != 0) return members;
    taken_[seed] = 1;
    members.push_back(seed);
    for (std::size_t next = 0; next < members.size(); ++next)
      visit_neighbours(members[next], accept, &members);
    return members;
  }

  /// Takes the neighbours of `from` that `accept` into `members`.
  template <typename Accept>
  void visit_neighbours(std::size_t from, const Accept& accept, std::vector<std::size_t>* members) {
    for_touching(from, [&](std::size_t other) {
      if (taken_[other] != 0 || !accept(other)) return;
      taken_[other] = 1;
      members->push_back(other);
    });
  }

  /// Takes into `members` the cells that `accept` and that lead down from one of them, `up` in the lidar
  /// frame.
  template <typename Accept>
  void take_feet(const Eigen::Vector3f& up, const Accept& accept, std::vector<std::size_t>* members) {
    const std::size_t above = members->size();
    for (std::size_t k = 0; k < above; ++k) {
      const Eigen::Vector3f top = position((*members)[k]);
      const auto is_foot = [&](std::size_t at) {
        const Eigen::Vector3f down = top - position(at);
        const float depth = up.dot(down);
        return depth > 0.0F && depth <= kFootDepthM &&
               down.squaredNorm() - depth * depth <= kFootM * kFootM && accept(at);
      };
      std::size_t next = members->size();
      visit_neighbours((*members)[k], is_foot, members);
      for (; next < members->size(); ++next) visit_neighbours((*members)[next], is_foot, members);
    }
  }

  /// Number of cells that `accept` and that touch one of `members`.
  template <typename Accept>
  std::size_t count_touching(const std::vector<std::size_t>& members, const Accept& accept) const {
    std::unordered_set<std::size_t> found;
    for (const std::size_t from : members) {
      for_touching(from, [&](std::size_t other) {
        if (accept(other)) found.insert(other);
      });
    }
    return found.size();
  }

  /// Whether the surface between the cell and those above and below it may be ground; `up` in the lidar
  /// frame.
  bool is_level(std::size_t at, const Eigen::Vector3f& up) const {
    const auto columns = static_cast<std::size_t>(columns_);
    const int ring = static_cast<int>(at / columns);
    const int column = static_cast<int>(at % columns);
    const Eigen::Vector3f& p = position(at);
    for (const int other : {ring - 1, ring + 1}) {
      if (other < 0 || other >= image_.rings()) continue;
      const std::uint32_t j = point_of(other, column);
      if (j == RangeImage::kNone) continue;
      const Eigen::Vector3f d = scan_.points[j].position - p;
      const float rise = up.dot(d);
      if (rise * rise > kMostSlope * kMostSlope * (d.squaredNorm() - rise * rise)) return false;
    }
    return true;
  }

 private:
  template <typename Visit>
  void for_touching(std::size_t from, const Visit& visit) const {
    const auto columns = static_cast<std::size_t>(columns_);
    const int ring = static_cast<int>(from / columns);
    const int column = static_cast<int>(from % columns);
    const Eigen::Vector3f& p = position(from);
    const float reach =
        static_cast<float>(config_.touch_distance_m) + static_cast<float>(config_.touch_share) * p.norm();
    for (int dr = -2; dr <= 2; ++dr) {
      if (ring + dr < 0 || ring + dr >= image_.rings()) continue;
      for (int dc = -2; dc <= 2; ++dc) {
        const std::size_t other = cell(ring + dr, column + dc);
        const std::uint32_t j = point_of(other);
        if (other == from || j == RangeImage::kNone) continue;
        if ((scan_.points[j].position - p).squaredNorm() <= reach * reach) visit(other);
      }
    }
  }

  const Eigen::Vector3f& position(std::size_t at) const { return scan_.points[point_of(at)].position; }

  const DeskewedScan& scan_;
  const RangeImage& image_;
  const DynamicConfig& config_;
  int columns_;
  std::vector<char> taken_;
};

}  // namespace

std::vector<RemovalReason> DynamicFilter::classify(const DeskewedScan& scan, const RangeImage& image,
                                                   const Eigen::Isometry3d& T_odom_lidar) {
  if (config_.mode == "off") return {};
  if (config_.mode == "plain") return plain(scan, image);
  std::vector<RemovalReason> reasons = full(scan, image, T_odom_lidar);
  remember(scan, image, T_odom_lidar, reasons);
  return reasons;
}

std::vector<RemovalReason> DynamicFilter::plain(const DeskewedScan& scan, const RangeImage& image) const {
  std::vector<RemovalReason> reasons(scan.points.size(), RemovalReason::kNone);
  if (scan.intensity_gradient.empty()) return reasons;
  double sum = 0.0;
  double squares = 0.0;
  for (const float gradient : scan.intensity_gradient) {
    sum += gradient;
    squares += static_cast<double>(gradient) * gradient;
  }
  const auto count = static_cast<double>(scan.points.size());
  const double mean = sum / count;
  const double deviation = std::sqrt(std::max(0.0, squares / count - mean * mean));
  const auto threshold = static_cast<float>(mean + config_.gradient_deviations * deviation);
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    if (scan.intensity_gradient[i] <= threshold) continue;
    const Point& point = scan.points[i];
    const float range = image.range_at(point.ring, point.column);
    const auto limit = static_cast<float>(config_.safety_factor * config_.range_jump) * range;
    float jump = 0.0F;
    float distance = 0.0F;
    int neighbours = 0;
    for (int dr = -1; dr <= 1; ++dr) {
      if (point.ring + dr < 0 || point.ring + dr >= image.rings()) continue;
      for (int dc = -1; dc <= 1; ++dc) {
        const std::uint32_t j = image.at(point.ring + dr, point.column + dc);
        if (j == RangeImage::kNone || j == i) continue;
        if (dr == 0) jump = std::max(jump, std::abs(image.range_at(point.ring, point.column + dc) - range));
        distance += (scan.points[j].position - point.position).norm();
        ++neighbours;
      }
    }
    if (neighbours > 0 && jump > limit && distance / static_cast<float>(neighbours) > limit)
      reasons[i] = RemovalReason::kCriterion;
  }
  return reasons;
}

std::vector<const DynamicFilter::Past*> DynamicFilter::chosen_past(Stamp now) const {
  std::vector<const Past*> chosen;
  for (int k = 1; k <= config_.past_scans; ++k) {
    const double age_s = config_.past_spacing_s * k;
    const Past* best = nullptr;
    for (const Past& past : history_) {
      const double error_s = std::abs(seconds_between(past.stamp, now) - age_s);
      if (error_s > 0.5 * config_.past_spacing_s) continue;
      if (best == nullptr || error_s < std::abs(seconds_between(best->stamp, now) - age_s)) best = &past;
    }
    if (best != nullptr) chosen.push_back(best);
  }
  return chosen;
}

float DynamicFilter::margin_m(float range_m) const {
  return static_cast<float>(config_.free_margin_m) + static_cast<float>(config_.free_margin_share) * range_m;
}

std::vector<DynamicFilter::Evidence> DynamicFilter::weigh(const std::vector<Eigen::Vector3f>& points,
                                                          const std::vector<const Past*>& past,
                                                          const Eigen::Isometry3d& T_odom_lidar) const {
  struct Votes {
    std::uint8_t free = 0;
    std::uint8_t fixed = 0;
    std::uint8_t moved = 0;  ///< of `fixed`: by what was found to move then
  };
  std::vector<Votes> votes(points.size());
  const auto ask = [&](const Past& each, const std::vector<Eigen::Vector3f>& about, const auto& votes_on) {
    const Eigen::Isometry3f T_past_now = (each.T_odom_lidar.inverse() * T_odom_lidar).cast<float>();
    look_up(each.image, T_past_now, about, [&](std::size_t k, int ring, int column, float range) {
      const float margin = margin_m(range);
      const float centre = each.image.range_at(ring, column);
      if (centre > 0.0F && std::abs(centre - range) <= 0.5F * margin) {
        ++votes_on(k).fixed;
        if (each.is_moving(ring, column)) ++votes_on(k).moved;
      } else if (each.image.saw_farther(ring, column, range + margin)) {
        ++votes_on(k).free;
      }
    });
  };
  const std::size_t first = std::min(kAskedFirst, past.size());
  for (std::size_t k = 0; k < first; ++k)
    ask(*past[k], points, [&votes](std::size_t i) -> Votes& { return votes[i]; });
  std::vector<Eigen::Vector3f> open;
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (votes[i].fixed > votes[i].moved && votes[i].free == 0) continue;
    open.push_back(points[i]);
    numbers.push_back(i);
  }
  for (std::size_t k = first; k < past.size(); ++k)
    ask(*past[k], open, [&](std::size_t i) -> Votes& { return votes[numbers[i]]; });

  std::vector<Evidence> evidence(points.size(), Evidence::kUnknown);
  for (std::size_t i = 0; i < points.size(); ++i) {
    // What moved then is no witness of standing still, where another scan looks through. Without one it is:
    // what was once taken for moving by mistake would stay so.
    const int fixed = votes[i].free > 0 ? votes[i].fixed - votes[i].moved : votes[i].fixed;
    if (fixed > 0 && fixed >= votes[i].free) {
      evidence[i] = Evidence::kStatic;
    } else if (votes[i].free > 0) {
      evidence[i] = Evidence::kFree;
    }
  }
  return evidence;
}

std::vector<bool> DynamicFilter::drive_along(const std::vector<Eigen::Vector3f>& points,
                                             const std::vector<const Past*>& past, const RangeImage& image,
                                             const Eigen::Isometry3d& T_odom_lidar, Stamp now) const {
  std::vector<bool> result(points.size(), false);
  const auto way = [&](const Past* each) {
    return Eigen::Vector3d(T_odom_lidar.inverse() * each->T_odom_lidar.translation());
  };
  const auto then =
      std::find_if(past.begin(), past.end(), [&](const Past* each) { return way(each).norm() >= kLeastWay; });
  if (then == past.end()) return result;
  // The same direction from the sensor, then: turned as the sensor has turned, but not moved.
  Eigen::Isometry3f T_then_now = Eigen::Isometry3f::Identity();
  T_then_now.linear() = ((*then)->T_odom_lidar.linear().transpose() * T_odom_lidar.linear()).cast<float>();
  std::vector<Eigen::Vector3f> left;
  std::vector<std::size_t> numbers;
  const Eigen::Vector3f t_now_then = way(*then).cast<float>();
  const float closing_m = kMostClosing * static_cast<float>(seconds_between((*then)->stamp, now));
  look_up((*then)->image, T_then_now, points, [&](std::size_t k, int ring, int column, float range) {
    const float centre = (*then)->image.range_at(ring, column);
    if (centre <= 0.0F || std::abs(centre - range) > margin_m(range) + closing_m) return;
    left.push_back(points[k] * (centre / range) + t_now_then);
    numbers.push_back(k);
  });
  look_up(image, Eigen::Isometry3f::Identity(), left, [&](std::size_t k, int ring, int column, float range) {
    result[numbers[k]] = image.saw_farther(ring, column, range + margin_m(range));
  });
  return result;
}

std::vector<RemovalReason> DynamicFilter::full(const DeskewedScan& scan, const RangeImage& image,
                                               const Eigen::Isometry3d& T_odom_lidar) const {
  std::vector<RemovalReason> reasons(scan.points.size(), RemovalReason::kNone);
  const std::vector<const Past*> past = chosen_past(scan.stamp);
  if (past.empty()) return reasons;

  const Eigen::Vector3f up = T_odom_lidar.linear().row(2).transpose().cast<float>();
  ObjectGrower grower(scan, image, config_);
  const auto rings = static_cast<std::size_t>(image.rings());
  const auto columns = static_cast<std::size_t>(grower.columns());
  std::vector<Evidence> evidence(rings * columns, Evidence::kNone);
  parallel_chunks(rings, 4, [&](std::size_t begin, std::size_t end, std::size_t) {
    std::vector<Eigen::Vector3f> points;
    std::vector<std::size_t> cells;
    for (std::size_t ring = begin; ring < end; ++ring) {
      for (std::size_t column = 0; column < columns; ++column) {
        const std::uint32_t i = grower.point_of(static_cast<int>(ring), static_cast<int>(column));
        if (i == RangeImage::kNone) continue;
        points.push_back(scan.points[i].position);
        cells.push_back(ring * columns + column);
      }
    }
    const std::vector<Evidence> found = weigh(points, past, T_odom_lidar);
    for (std::size_t k = 0; k < cells.size(); ++k) evidence[cells[k]] = found[k];
    std::vector<Eigen::Vector3f> hidden;
    std::vector<std::size_t> hidden_cells;
    for (std::size_t k = 0; k < cells.size(); ++k) {
      if (found[k] != Evidence::kUnknown || grower.is_level(cells[k], up)) continue;
      hidden.push_back(points[k]);
      hidden_cells.push_back(cells[k]);
    }
    const std::vector<bool> moves = drive_along(hidden, past, image, T_odom_lidar, scan.stamp);
    for (std::size_t k = 0; k < hidden.size(); ++k) {
      if (moves[k]) evidence[hidden_cells[k]] = Evidence::kFree;
    }
  });

  std::vector<RemovalReason> of_cell(rings * columns, RemovalReason::kNone);
  const auto is = [&evidence](Evidence wanted) {
    return [&evidence, wanted](std::size_t at) { return evidence[at] == wanted; };
  };
  for (std::size_t seed = 0; seed < evidence.size(); ++seed) {
    if (evidence[seed] != Evidence::kFree) continue;
    const std::vector<std::size_t> core = grower.grow(seed, is(Evidence::kFree));
    if (core.size() < static_cast<std::size_t>(config_.min_object_points)) continue;
    const std::size_t fixed = grower.count_touching(core, is(Evidence::kStatic));
    if (static_cast<double>(fixed) > config_.max_static_share * static_cast<double>(core.size() + fixed))
      continue;
    std::vector<std::size_t> members = core;
    const auto joins = [&](std::size_t at) {
      return members.size() < kMostGrowth * core.size() && evidence[at] == Evidence::kUnknown &&
             !grower.is_level(at, up);
    };
    for (std::size_t next = 0; next < members.size(); ++next)
      grower.visit_neighbours(members[next], joins, &members);
    grower.take_feet(
        up, [&](std::size_t at) { return evidence[at] != Evidence::kFree && !grower.is_level(at, up); },
        &members);
    for (const std::size_t at : members) {
      of_cell[at] =
          evidence[at] == Evidence::kFree ? RemovalReason::kFreeSpace : RemovalReason::kPartOfObject;
    }
  }
  const auto touch = static_cast<float>(config_.touch_distance_m);
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    const Point& point = scan.points[i];
    const std::size_t at = grower.cell(point.ring, point.column / kColumnStride);
    if (of_cell[at] == RemovalReason::kNone) continue;
    const Eigen::Vector3f& looked_at = scan.points[grower.point_of(at)].position;
    if ((looked_at - point.position).squaredNorm() <= touch * touch) reasons[i] = of_cell[at];
  }
  return reasons;
}

void DynamicFilter::remember(const DeskewedScan& scan, const RangeImage& image,
                             const Eigen::Isometry3d& T_odom_lidar,
                             const std::vector<RemovalReason>& reasons) {
  Past past{scan.stamp, image, T_odom_lidar, {}};
  const auto columns = static_cast<std::size_t>(image.columns());
  past.moving.assign(static_cast<std::size_t>(image.rings()) * columns, 0);
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (reasons[i] == RemovalReason::kNone) continue;
    const Point& point = scan.points[i];
    if (image.at(point.ring, point.column) == i) past.moving[point.ring * columns + point.column] = 1;
  }
  history_.push_back(std::move(past));
  const double kept_s = config_.past_spacing_s * (config_.past_scans + 0.5);
  while (seconds_between(history_.front().stamp, scan.stamp) > kept_s) history_.pop_front();
}

void DynamicFilter::correct_newest(Stamp stamp, const Eigen::Isometry3d& T_odom_lidar) {
  if (history_.empty() || history_.back().stamp != stamp) return;
  const double off_m = (history_.back().T_odom_lidar.translation() - T_odom_lidar.translation()).norm();
  if (off_m > kRevisedM) history_.erase(history_.begin(), history_.end() - 1);
  history_.back().T_odom_lidar = T_odom_lidar;
}

}  // namespace fdi_lio::scan
