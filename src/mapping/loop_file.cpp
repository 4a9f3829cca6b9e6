#include "fdi_lio/mapping/loop_file.hpp"

#include <cstdio>
#include <fstream>
#include <limits>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::mapping {

void write_loops(const std::string& path, const std::vector<LoopCandidate>& loops) {
  const std::string temporary = path + ".part";
  std::ofstream out(temporary);
  out.precision(std::numeric_limits<double>::max_digits10);
  out << "stamp_from,stamp_to,source,verdict,overlap,wall_share,residual,intensity_correlation,chi_square,"
         "weak_directions,tx,ty,tz,qx,qy,qz,qw";
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) out << ",c" << row << column;
  }
  out << '\n';
  for (const LoopCandidate& loop : loops) {
    const Eigen::Quaterniond q(loop.measured.T_from_to.linear());
    const Eigen::Vector3d t = loop.measured.T_from_to.translation();
    out << stamp_text(loop.stamp_from) << ',' << stamp_text(loop.stamp_to) << ',' << to_text(loop.source)
        << ',' << to_text(loop.verdict) << ',' << loop.overlap << ',' << loop.wall_share << ','
        << loop.residual_m << ',' << loop.intensity_correlation << ',' << loop.chi_square << ','
        << loop.weak_directions << ',' << t.x() << ',' << t.y() << ',' << t.z() << ',' << q.x() << ','
        << q.y() << ',' << q.z() << ',' << q.w();
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) out << ',' << loop.covariance(row, column);
    }
    out << '\n';
  }
  out.close();
  if (!out || std::rename(temporary.c_str(), path.c_str()) != 0)
    throw Error("cannot write " + path + ": check free space and permission");
}

}  // namespace fdi_lio::mapping
