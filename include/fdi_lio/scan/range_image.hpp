#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::scan {

/// A deskewed scan by ring and azimuth: row = ring (0 is the lowest), column = clockwise from behind. A cell
/// holds at most one point, the nearest that fell into it. Ranges and directions are those from where the
/// lidar was when it looked (`DeskewedScan::sweep`): at 30 m/s that is up to 3 m from where the sweep
/// ended, and seen from there a ring is no cone. Nor is it one about the axis at the end, when the lidar
/// nods: in a hand by up to 17 degrees a sweep. Neighbours in space are looked for in a window of cells,
/// at constant cost.
class RangeImage {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// Replaces the content and sets `Point::column` of every point. The number of columns is found from the
  /// spacing of the points and kept while it fits.
  void build(DeskewedScan* scan);

  /// Forgets the points that have a reason, and numbers the others as remove_points leaves them.
  void remove(const std::vector<RemovalReason>& reasons);

  int rings() const { return rings_; }
  int columns() const { return columns_; }
  bool empty() const { return index_.empty(); }

  /// Index of the point in a cell, or kNone; `column` may be off by less than a revolution.
  std::uint32_t at(int ring, int column) const { return index_[cell(ring, column)]; }
  /// Range of the point in a cell, from where it was seen [m]; 0 without one.
  float range_at(int ring, int column) const { return range_[cell(ring, column)]; }

  /// Whether all of the nine cells about a direction that hold a range saw farther than `range_m`, and enough
  /// do.
  bool saw_farther(int ring, int column, float range_m) const;

  /// The same of the three cells on the ring alone: what its neighbours saw, above and below, is left open.
  bool ring_saw_farther(int ring, int column, float range_m) const;

  /// Unit vector along the beam of a ring that passes above or below a point, as `look_at` left it (seen from
  /// where the lidar was then), in the column that it lies in.
  Eigen::Vector3f beam_towards(int ring, int column, const Eigen::Vector3f& point) const;

  /// Cell that looks towards a point in this scan's lidar frame.
  struct Direction {
    int ring = 0;
    int column = 0;
    float range_m = 0.0F;
    bool is_inside = false;  ///< false: above, below or between the beams by more than their spacing
  };
  Direction look_at(const Eigen::Vector3f& point) const;

  /// The same for many points, several at a time.
  struct Directions {
    static constexpr int kSize = 64;
    using Floats = std::array<float, kSize>;
    using Integers = std::array<std::int32_t, kSize>;
    Floats x{}, y{}, z{};  ///< points [m]
    Floats range_m{};
    Integers column{};
    Integers ring{};  ///< -1 where no beam looks

    void set(int k, const Eigen::Vector3f& point) {
      x[k] = point.x();
      y[k] = point.y();
      z[k] = point.z();
    }
  };
  /// Fills range, column and ring of the points (x, y, z), which are moved to `T` times them and to where the
  /// lidar saw them from.
  void look_at(const Eigen::Isometry3f& T, Directions* directions) const;

 private:
  static constexpr int kElevationBins = 4096;

  std::size_t cell(int ring, int column) const {
    const int wrapped = column < 0 ? column + columns_ : (column >= columns_ ? column - columns_ : column);
    return static_cast<std::size_t>(ring) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(wrapped);
  }
  bool saw_farther(int first_ring, int last_ring, int column, float range_m, int least_cells) const;
  void learn_motion(const DeskewedScan& scan);
  /// Moves the points to directions from where the lidar looked at them from.
  void move_to_origins(Directions* directions) const;
  /// Fills range and column.
  void project(Directions* directions) const;
  void choose_columns(const DeskewedScan& scan);
  void learn_elevations(const DeskewedScan& scan);

  int rings_ = 0;
  int columns_ = 0;
  std::vector<std::uint32_t> index_;
  std::vector<float> range_;
  Eigen::Vector3f sweep_start_ = Eigen::Vector3f::Zero();
  std::vector<float> seen_ago_;                              ///< of each column, as a share of the sweep
  bool turns_ = false;                                       ///< the lidar's axis, during the sweep
  std::vector<float> axis_x_, axis_y_, axis_z_;              ///< of each column, if it turns
  std::vector<float> sine_of_ring_;                          ///< of the elevation, mean of the ring's beams
  std::array<std::int16_t, kElevationBins> ring_of_sine_{};  ///< -1: no beam looks there
};

/// atan2 by a polynomial: within 1e-5 rad, far less than a cell.
float fast_atan2(float y, float x);

}  // namespace fdi_lio::scan
