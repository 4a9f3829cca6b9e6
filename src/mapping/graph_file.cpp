#include "fdi_lio/mapping/graph_file.hpp"

#include <fstream>
#include <limits>
#include <sstream>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::mapping {

namespace {

/// Our tangent from g2o's, both small: [dtheta, dt] = J [dt_to, dq]. A rotation of theta has the vector part
/// theta / 2.
Matrix6d tangent_from_g2o(const Eigen::Isometry3d& T_from_to) {
  Matrix6d J = Matrix6d::Zero();
  J.topRightCorner<3, 3>() = 2.0 * Eigen::Matrix3d::Identity();
  J.bottomLeftCorner<3, 3>() = T_from_to.linear();
  return J;
}

void write_pose(const Eigen::Isometry3d& T, std::ostream& out) {
  const Eigen::Quaterniond q(T.linear());
  const Eigen::Vector3d t = T.translation();
  out << t.x() << ' ' << t.y() << ' ' << t.z() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' '
      << q.w();
}

void write_edge(const RelativePose& edge, std::ostream& out) {
  out << "EDGE_SE3:QUAT " << edge.from << ' ' << edge.to << ' ';
  write_pose(edge.T_from_to, out);
  const Matrix6d J = tangent_from_g2o(edge.T_from_to);
  const Matrix6d information = J.transpose() * edge.information * J;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) out << ' ' << information(row, column);
  }
  out << '\n';
}

bool read_pose(std::istream& in, Eigen::Isometry3d* T) {
  Eigen::Vector3d t;
  Eigen::Quaterniond q;
  in >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
  if (!in || std::abs(q.norm() - 1.0) > 1e-3) return false;
  T->setIdentity();
  T->linear() = q.normalized().toRotationMatrix();
  T->translation() = t;
  return true;
}

bool read_edge(std::istream& in, std::size_t node_count, RelativePose* edge) {
  in >> edge->from >> edge->to;
  if (!in || edge->from >= node_count || edge->to >= node_count || !read_pose(in, &edge->T_from_to))
    return false;
  Matrix6d information;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      in >> information(row, column);
      information(column, row) = information(row, column);
    }
  }
  if (!in) return false;
  const Matrix6d J_inverse = tangent_from_g2o(edge->T_from_to).inverse();
  edge->information = J_inverse.transpose() * information * J_inverse;
  return true;
}

}  // namespace

void write_g2o(const std::string& path, const GraphFile& graph) {
  std::ofstream out(path);
  out.precision(std::numeric_limits<double>::max_digits10);
  for (std::size_t node = 0; node < graph.poses.size(); ++node) {
    out << "VERTEX_SE3:QUAT " << node << ' ';
    write_pose(graph.poses[node], out);
    out << '\n';
  }
  if (!graph.poses.empty()) out << "FIX 0\n";
  for (const RelativePose& edge : graph.odometry) write_edge(edge, out);
  for (const RelativePose& edge : graph.loops) write_edge(edge, out);
  out.close();
  if (!out) throw Error("cannot write " + path + ": check free space and permission");
}

GraphFile read_g2o(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw Error("cannot read the pose graph " + path);
  GraphFile graph;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    std::istringstream fields(line);
    std::string kind;
    fields >> kind;
    bool is_good = kind.empty() || kind == "FIX";
    if (kind == "VERTEX_SE3:QUAT") {
      std::size_t node = 0;
      fields >> node;
      graph.poses.emplace_back();
      is_good = fields && node + 1 == graph.poses.size() && read_pose(fields, &graph.poses.back());
    } else if (kind == "EDGE_SE3:QUAT") {
      RelativePose edge;
      is_good = read_edge(fields, graph.poses.size(), &edge);
      (edge.to == edge.from + 1 ? graph.odometry : graph.loops).push_back(edge);
    }
    if (!is_good)
      throw Error(path + ", line " + std::to_string(number) + ": not a pose graph of this program: " + line);
  }
  return graph;
}

}  // namespace fdi_lio::mapping
