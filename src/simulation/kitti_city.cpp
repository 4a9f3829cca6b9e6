#include <algorithm>
#include <cmath>
#include <memory>

#include "fdi_lio/simulation/buildings.hpp"
#include "fdi_lio/simulation/kitti_motion.hpp"
#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

/// The way that was driven: points about 2 m apart on the ground, with headings.
struct Way {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> headings;

  double distance(const Eigen::Vector2d& p) const {
    double nearest = 1e12;
    for (const Eigen::Vector3d& point : points)
      nearest = std::min(nearest, (point.head<2>() - p).squaredNorm());
    return std::sqrt(nearest);
  }
};

Way sample_way(const Trajectory& trajectory, double imu_height) {
  Way way;
  for (double t = 0.0; t < trajectory.duration_s(); t += 0.05) {
    const MotionState state = trajectory.evaluate(t);
    const Eigen::Vector3d p = state.T_map_imu.translation() - Eigen::Vector3d(0.0, 0.0, imu_height);
    if (!way.points.empty() && (way.points.back() - p).norm() < 2.0) continue;
    way.points.push_back(p);
    const Eigen::Vector3d ahead = state.T_map_imu.linear().col(0);
    way.headings.push_back(std::atan2(ahead.y(), ahead.x()));
  }
  return way;
}

/// Heights on a grid that pass through the way, blended by distance; bilinear between the nodes.
class HeightMap {
 public:
  static constexpr double kNode = 3.0;
  static constexpr double kMargin = 60.0;

  explicit HeightMap(const Way& way) {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector3d& p : way.points) box.extend(Eigen::Vector2d(p.head<2>()));
    origin_ = box.min() - Eigen::Vector2d::Constant(kMargin);
    columns_ = static_cast<int>((box.sizes().x() + 2.0 * kMargin) / kNode) + 2;
    rows_ = static_cast<int>((box.sizes().y() + 2.0 * kMargin) / kNode) + 2;
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        const Eigen::Vector2d p = node(column, row);
        double sum = 0.0, total = 0.0;
        for (const Eigen::Vector3d& q : way.points) {
          const double d2 = (q.head<2>() - p).squaredNorm() + 6.0;
          const double weight = 1.0 / (d2 * d2);
          sum += weight * q.z();
          total += weight;
        }
        heights_.push_back(sum / total);
      }
    }
  }

  Eigen::Vector2d node(int column, int row) const { return origin_ + kNode * Eigen::Vector2d(column, row); }
  int columns() const { return columns_; }
  int rows() const { return rows_; }

  double at(double x, double y) const {
    const double u = std::clamp((x - origin_.x()) / kNode, 0.0, columns_ - 1.001);
    const double v = std::clamp((y - origin_.y()) / kNode, 0.0, rows_ - 1.001);
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const double a = u - i, b = v - j;
    return (1 - b) * ((1 - a) * height(i, j) + a * height(i + 1, j)) +
           b * ((1 - a) * height(i, j + 1) + a * height(i + 1, j + 1));
  }
  double height(int column, int row) const {
    return heights_[static_cast<std::size_t>(row * columns_ + column)];
  }

 private:
  Eigen::Vector2d origin_;
  int columns_ = 0, rows_ = 0;
  std::vector<double> heights_;
};

void add_terrain(WorldBuilder* b, const HeightMap& map, const Way& way) {
  constexpr double kRoad = 6.0;  // metres to each side of the way
  constexpr double kField = 60.0;
  const MaterialId asphalt = b->mottled(0.22, 0.3, 3.0), grass = b->mottled(0.4, 0.4, 1.5);
  const auto corner = [&](int i, int j) {
    const Eigen::Vector2d p = map.node(i, j);
    return Eigen::Vector3d(p.x(), p.y(), map.height(i, j));
  };
  for (int row = 0; row + 1 < map.rows(); ++row) {
    for (int column = 0; column + 1 < map.columns(); ++column) {
      const Eigen::Vector3d a = corner(column, row);
      const double distance = way.distance(a.head<2>());
      if (distance > kField) continue;
      add_quad(&b->mesh, a, corner(column + 1, row), corner(column + 1, row + 1), corner(column, row + 1),
               distance < kRoad ? asphalt : grass, a.head<2>());
    }
  }
}

void add_houses(WorldBuilder* b, const HeightMap& map, const Way& way) {
  constexpr double kClear = 6.0;
  Random& r = b->random;
  for (const double side : {1.0, -1.0}) {
    for (std::size_t i = 4; i + 4 < way.points.size(); i += 5 + static_cast<std::size_t>(r.index(6))) {
      const Eigen::Vector2d along = Eigen::Rotation2Dd(way.headings[i]).toRotationMatrix().col(0);
      const Eigen::Vector2d out = side * Eigen::Vector2d(-along.y(), along.x());
      const Eigen::Vector2d front = way.points[i].head<2>() + r.uniform(8.0, 14.0) * out;
      const double half = r.uniform(4.5, 10.0);
      BuildingLot lot;
      lot.depth = r.uniform(8.0, 12.0);
      lot.height = r.uniform(6.0, 14.0);
      lot.front_left = front - side * half * along;
      lot.front_right = front + side * half * along;
      lot.base_z = map.at(front.x(), front.y());
      bool clear = true;
      for (double u = -half; u <= half && clear; u += 0.5 * half) {
        for (double v = 0.0; v <= lot.depth; v += 0.5 * lot.depth)
          clear = clear && way.distance(front + u * along + v * out) > kClear;
      }
      if (clear && r.chance(0.85)) add_building(b, lot);
    }
  }
}

void add_roadside(WorldBuilder* b, const PropMaterials& m, const HeightMap& map, const Way& way) {
  Random& r = b->random;
  for (std::size_t i = 2; i + 2 < way.points.size(); i += 2) {
    for (const double side : {1.0, -1.0}) {
      const double heading = way.headings[i];
      const Eigen::Vector2d out = side * Eigen::Vector2d(-std::sin(heading), std::cos(heading));
      const double aside = r.uniform(3.2, 6.5);
      const Eigen::Vector2d p = way.points[i].head<2>() + aside * out;
      const double clearance = way.distance(p), draw = r.uniform();
      const Eigen::Vector3d foot(p.x(), p.y(), map.at(p.x(), p.y()));
      if (draw < 0.35 * b->settings.parked_share && clearance > 2.9) {
        b->mesh.append(make_car(b, m, draw_car_kind(&r)), pose_at(foot.x(), foot.y(), foot.z(), heading));
      } else if (draw > 1.0 - 0.12 * b->settings.trees && clearance > 4.0) {
        add_tree(b, m, foot, r.uniform(4.0, 9.0));
      } else if (draw > 0.5 && draw < 0.54 && clearance > 2.5) {
        add_lamp_post(b, m, foot, heading - side * 0.5 * M_PI);
      } else if (draw > 0.6 && draw < 0.6 + 0.04 * b->settings.marks && clearance > 2.5) {
        add_sign(b, m, foot, heading + M_PI);
      } else if (draw > 0.7 && draw < 0.73 && clearance > 3.0) {
        add_street_furniture(b, m, foot, heading);
      }
    }
  }
}

}  // namespace

Place make_kitti_city(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(load_kitti_motion(scenario.motion.pose_file, scenario.duration_s));
  const Way way = sample_way(*place.trajectory, scenario.motion.imu_height_m);
  const HeightMap map(way);
  add_terrain(&b, map, way);
  add_houses(&b, map, way);
  add_roadside(&b, materials, map, way);
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
