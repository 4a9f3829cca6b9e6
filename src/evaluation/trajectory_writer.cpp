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

namespace {

void write_kitti(const std::string& path, const std::vector<StampedPose>& poses) {
  std::ofstream out(path);
  out.precision(12);
  for (const StampedPose& pose : poses) {
    const Eigen::Matrix4d T = pose.T.matrix();
    for (int cell = 0; cell < 12; ++cell) out << (cell == 0 ? "" : " ") << T(cell / 4, cell % 4);
    out << '\n';
  }
  out.close();
  if (!out) throw Error("cannot write " + path + ": check free space and permission");
}

}  // namespace

TrajectoryFormat to_trajectory_format(const std::string& text) {
  if (text == "tum") return TrajectoryFormat::kTum;
  if (text == "kitti") return TrajectoryFormat::kKitti;
  throw Error("the format '" + text + "' is not known: choose tum or kitti");
}

void write_trajectory(const std::string& path, const std::vector<StampedPose>& poses,
                      TrajectoryFormat format) {
  if (format == TrajectoryFormat::kKitti) {
    write_kitti(path, poses);
    return;
  }
  TrajectoryWriter writer(path);
  for (const StampedPose& pose : poses)
    writer.add(pose.stamp, Eigen::Quaterniond(pose.T.linear()), pose.T.translation());
}

}  // namespace fdi_lio::evaluation
