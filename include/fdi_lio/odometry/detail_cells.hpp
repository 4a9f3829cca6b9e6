#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/odometry/bright_scan.hpp"

namespace fdi_lio::odometry {

/// What is asked of a BrightScan, number by number, so that several points are moved at a time.
struct LaneScan {
  double time_s = 0.0;  ///< since the first scan
  Eigen::Vector3d gained_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d gained_m = Eigen::Vector3d::Zero();
  std::vector<float> x;
  std::vector<float> y;
  std::vector<float> z;
  std::vector<float> point_time_s;
  std::vector<float> detail;
  std::vector<std::uint32_t> stands;  ///< 0 or 1
};

/// Every so many points of the scans.
std::vector<LaneScan> lanes_of(const std::vector<BrightScan>& scans, std::size_t stride);

/// Means of the details in cells of 0.5 m, of some scans under one velocity. Hundreds of velocities are
/// tried: cells are found by their column of the level plane, in a table that is small enough to stay in the
/// cache, and what the scans say of a cell is chained from the newest to the oldest.
class DetailCells {
 public:
  static constexpr float kBlockM = 4.0F;
  static constexpr int kBlocksAcross = static_cast<int>(2.0F * kBrightReachM / kBlockM);
  /// Blocks of what lies; as many of what stands follow.
  static constexpr std::size_t kLying = static_cast<std::size_t>(kBlocksAcross) * kBlocksAcross;
  static constexpr std::size_t kBlocks = 2 * kLying;

  /// What a block says of a velocity.
  struct Fit {
    float fit = 0.0F;
    float pairs = 0.0F;  ///< of means that were compared; 0: too few to say anything
  };
  using Fits = std::array<Fit, kBlocks>;

  /// -ln(mean squared difference + noise) / 2 of the means of scans that are at most `farthest` apart, by the
  /// blocks of the older; `velocity` at the first scan (level axes).
  Fits fits(const std::vector<LaneScan>& scans, const Eigen::Vector3d& velocity, std::size_t farthest);

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  static constexpr std::uint32_t kTableBits = 8;  ///< 128 m: farther apart, columns share an entry

  struct Cell {
    std::uint32_t key;
    std::uint32_t next;  ///< cell of the same column
    std::uint32_t newest_mean;
  };

  struct CellMean {
    float detail;
    std::uint16_t count;
    std::uint16_t scan;
    std::uint16_t block;
    std::uint32_t older;  ///< mean of the same cell
  };

  void clear();
  /// `velocity` at the scan, `sensor` where it was then.
  void add(const LaneScan& scan, std::uint16_t number, const Eigen::Vector3f& velocity,
           const Eigen::Vector3f& sensor);
  Cell& cell_at(std::uint32_t key);
  Fits compare(std::size_t farthest) const;

  std::vector<std::uint32_t> newest_of_ = std::vector<std::uint32_t>(1U << (2U * kTableBits), kNone);
  std::vector<Cell> cells_;
  std::vector<CellMean> means_;
  std::vector<std::uint32_t> keys_;  ///< memory of `add`
};

}  // namespace fdi_lio::odometry
