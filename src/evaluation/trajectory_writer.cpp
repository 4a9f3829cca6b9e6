#include "fdi_lio/evaluation/trajectory_writer.hpp"

#include <cstdio>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::evaluation {

TrajectoryWriter::TrajectoryWriter(const std::string& path) : path_(path), out_(path) {
  if (!out_) throw Error("cannot write " + path + ": check that the folder exists and may be written");
  out_ << "# stamp[s] tx ty tz[m] qx qy qz qw\n";
}

void TrajectoryWriter::add(Stamp stamp, const Eigen::Quaterniond& q, const Eigen::Vector3d& t) {
  char line[256];
  std::snprintf(line, sizeof(line), " %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", t.x(), t.y(), t.z(), q.x(),
                q.y(), q.z(), q.w());
  out_ << stamp_text(stamp) << line;
  if (!out_.flush()) throw Error("cannot write " + path_ + ": is there free space on the disk?");
}

}  // namespace fdi_lio::evaluation
