// dump_scans BAG TOPIC: prints every scan of a recording as the system reads it.

#include <cinttypes>
#include <cstdio>

#include "bag_source.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  fdi_lio::SensorConfig sensor;
  sensor.points_topic = argv[2];
  sensor.imu_topic = "";
  sensor.ring_count = 16;
  sensor.min_range_m = 0.0;
  fdi_lio::Reporter reporter;
  fdi_lio::tools::BagCallbacks callbacks;
  callbacks.on_imu = [](const fdi_lio::imu::ImuSample& /*sample*/) {};
  callbacks.on_timing = [](const std::string& /*stage*/, double /*ms*/) {};
  callbacks.on_progress = [](double /*position_s*/) { return true; };
  callbacks.on_scan = [](const fdi_lio::Scan& scan) {
    std::printf("scan %" PRId64 " %zu\n", scan.stamp, scan.points.size());
    for (const fdi_lio::Point& point : scan.points) {
      std::printf("%.9g %.9g %.9g %.9g %d %.9g\n", static_cast<double>(point.position.x()),
                  static_cast<double>(point.position.y()), static_cast<double>(point.position.z()),
                  static_cast<double>(point.intensity), point.ring, static_cast<double>(point.time_s));
    }
  };
  fdi_lio::tools::BagSource({argv[1]}, sensor, &reporter).read(0.0, 0.0, &reporter, callbacks);
  return 0;
}
