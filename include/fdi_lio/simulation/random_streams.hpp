#pragma once

#include <cstdint>

namespace fdi_lio::simulation {

/// Purposes of random streams; two purposes never share numbers.
enum RandomStream : std::uint64_t {
  kStreamWorld = 1,
  kStreamObjects,
  kStreamMotion,
  kStreamLidar,
  kStreamLidarErrors,
  kStreamImu,
  kStreamImuBias,
  kStreamGnss,
  kStreamWheels,
  kStreamGnssReflections,
  kStreamGnssOutages,
  kStreamImuAxes,
};

}  // namespace fdi_lio::simulation
