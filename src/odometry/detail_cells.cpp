#include "fdi_lio/odometry/detail_cells.hpp"

#include <cmath>
#include <utility>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/common/wide_vectors.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr float kCellM = 0.5F;
constexpr std::size_t kLeastCells = 8;     ///< that a block must have compared to say something
constexpr double kNoise = 0.02;            ///< variance of a detail by noise
constexpr std::uint32_t kAcrossBits = 11;  ///< 1 km of cells, then they begin again
constexpr std::uint32_t kAcrossMask = (1U << kAcrossBits) - 1U;

FDI_LIO_INLINE std::int32_t floor_of(float value) {
  const auto towards_zero = static_cast<std::int32_t>(value);
  return towards_zero - (static_cast<float>(towards_zero) > value ? 1 : 0);
}

/// The cell of each point. What lies in a cell is not compared with what stands in it.
FDI_LIO_WIDE_VECTORS void find_keys(const LaneScan& scan, const Eigen::Vector3f& velocity,
                                    const Eigen::Vector3f& sensor, std::uint32_t* keys) {
  const std::size_t size = scan.x.size();
  const float* x = scan.x.data();
  const float* y = scan.y.data();
  const float* z = scan.z.data();
  const float* time_s = scan.point_time_s.data();
  const std::uint32_t* stands = scan.stands.data();
  const float velocity_x = velocity.x();
  const float velocity_y = velocity.y();
  const float velocity_z = velocity.z();
  const float sensor_x = sensor.x();
  const float sensor_y = sensor.y();
  const float sensor_z = sensor.z();
  for (std::size_t k = 0; k < size; ++k) {
    const std::int32_t column = floor_of((sensor_x + (x[k] + time_s[k] * velocity_x)) / kCellM);
    const std::int32_t row = floor_of((sensor_y + (y[k] + time_s[k] * velocity_y)) / kCellM);
    const std::int32_t layer = floor_of((sensor_z + (z[k] + time_s[k] * velocity_z)) / kCellM);
    keys[k] = (static_cast<std::uint32_t>(column) & kAcrossMask) |
              (static_cast<std::uint32_t>(row) & kAcrossMask) << kAcrossBits |
              (2U * static_cast<std::uint32_t>(layer) + stands[k]) << (2U * kAcrossBits);
  }
}

std::size_t column_of(std::uint32_t key, std::uint32_t bits) {
  const std::uint32_t mask = (1U << bits) - 1U;
  return ((key >> kAcrossBits & mask) << bits) | (key & mask);
}

std::uint16_t block_of(const LaneScan& scan, std::size_t k, const Eigen::Vector3f& velocity) {
  constexpr int kAcross = DetailCells::kBlocksAcross;
  const float from_sensor_x = scan.x[k] + scan.point_time_s[k] * velocity.x();
  const float from_sensor_y = scan.y[k] + scan.point_time_s[k] * velocity.y();
  const std::int32_t x = floor_of((from_sensor_x + kBrightReachM) / DetailCells::kBlockM);
  const std::int32_t y = floor_of((from_sensor_y + kBrightReachM) / DetailCells::kBlockM);
  if (x < 0 || y < 0 || x >= kAcross || y >= kAcross) return DetailCells::kBlocks;
  return static_cast<std::uint16_t>((scan.stands[k] != 0 ? DetailCells::kLying : 0U) +
                                    static_cast<std::size_t>(y * kAcross + x));
}

}  // namespace

std::vector<LaneScan> lanes_of(const std::vector<BrightScan>& scans, std::size_t stride) {
  std::vector<LaneScan> result;
  for (const BrightScan& scan : scans) {
    LaneScan lanes;
    lanes.time_s = seconds_between(scans.front().stamp, scan.stamp);
    lanes.gained_mps = scan.gained_mps;
    lanes.gained_m = scan.gained_m;
    for (std::size_t k = 0; k < scan.points.size(); k += stride) {
      const BrightPoint& point = scan.points[k];
      lanes.x.push_back(point.position.x());
      lanes.y.push_back(point.position.y());
      lanes.z.push_back(point.position.z());
      lanes.point_time_s.push_back(point.time_s);
      lanes.detail.push_back(point.detail);
      lanes.stands.push_back(point.stands ? 1U : 0U);
    }
    result.push_back(std::move(lanes));
  }
  return result;
}

DetailCells::Fits DetailCells::fits(const std::vector<LaneScan>& scans, const Eigen::Vector3d& velocity,
                                    std::size_t farthest) {
  clear();
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const Eigen::Vector3d now = velocity + scans[k].gained_mps;
    const Eigen::Vector3d sensor = scans[k].time_s * velocity + scans[k].gained_m;
    add(scans[k], static_cast<std::uint16_t>(k), now.cast<float>(), sensor.cast<float>());
  }
  return compare(farthest);
}

void DetailCells::clear() {
  for (const Cell& cell : cells_) newest_of_[column_of(cell.key, kTableBits)] = kNone;
  cells_.clear();
  means_.clear();
}

void DetailCells::add(const LaneScan& scan, std::uint16_t number, const Eigen::Vector3f& velocity,
                      const Eigen::Vector3f& sensor) {
  keys_.resize(scan.x.size());
  find_keys(scan, velocity, sensor, keys_.data());
  const std::size_t first = means_.size();
  std::uint32_t in = kNone;  // the mean of the last point's cell
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    if (k == 0 || keys_[k] != keys_[k - 1]) {
      std::uint32_t& newest = cell_at(keys_[k]).newest_mean;
      if (newest == kNone || newest < first) {
        const std::uint32_t older = newest;
        newest = static_cast<std::uint32_t>(means_.size());
        means_.push_back({0.0F, 0, number, block_of(scan, k, velocity), older});
      }
      in = newest;
    }
    means_[in].detail += scan.detail[k];
    ++means_[in].count;
  }
  for (std::size_t k = first; k < means_.size(); ++k) means_[k].detail /= static_cast<float>(means_[k].count);
}

DetailCells::Cell& DetailCells::cell_at(std::uint32_t key) {
  std::uint32_t& newest = newest_of_[column_of(key, kTableBits)];
  for (std::uint32_t k = newest; k != kNone; k = cells_[k].next) {
    if (cells_[k].key == key) return cells_[k];
  }
  cells_.push_back({key, newest, kNone});
  newest = static_cast<std::uint32_t>(cells_.size() - 1);
  return cells_.back();
}

DetailCells::Fits DetailCells::compare(std::size_t farthest) const {
  std::array<float, kBlocks> squares{};
  std::array<std::uint32_t, kBlocks> counts{};
  for (const CellMean& newer : means_) {
    for (std::uint32_t k = newer.older; k != kNone; k = means_[k].older) {
      const CellMean& older = means_[k];
      if (older.scan + farthest < newer.scan) break;
      if (older.block >= kBlocks) continue;
      const float difference = newer.detail - older.detail;
      squares[older.block] += difference * difference;
      ++counts[older.block];
    }
  }
  Fits result;
  for (std::size_t b = 0; b < kBlocks; ++b) {
    if (counts[b] < kLeastCells) continue;
    const double mean = static_cast<double>(squares[b]) / static_cast<double>(counts[b]);
    result[b] = {static_cast<float>(-0.5 * std::log(mean + kNoise)), static_cast<float>(counts[b])};
  }
  return result;
}

}  // namespace fdi_lio::odometry
