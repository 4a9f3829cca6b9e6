#include "fdi_lio/mapping/loop_verifier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr int kIterations = 20;
constexpr int kWideIterations = 6;
constexpr double kStartResidualM = 2.0;
constexpr double kEndResidualM = 0.3;
constexpr std::size_t kMinMatches = 100;
constexpr std::size_t kRefinedScorePoints = 3000;
constexpr double kConvergedM = 1e-4;

/// How far off the step from one keyframe to the next may be.
constexpr double kStepSigmaM = 0.5;
constexpr double kStepSigmaRad = M_PI / 180.0;

/// The grid of starts about the prediction: its step is what the coarsest cells still attract.
constexpr double kGridStepM = 1.0;
constexpr double kMinSearchM = 1.0;
constexpr double kMaxSearchM = 8.0;
constexpr double kYawStepRad = 0.05;
constexpr double kMaxYawSearchRad = 0.15;
constexpr std::size_t kScorePoints = 400;
constexpr std::size_t kStarts = 4;
/// Two results that are nearer to each other are the same.
constexpr double kSameResultM = 0.7;
/// A surface whose normal points up more is ground: it fits everywhere.
constexpr double kMaxWallNormalZ = 0.7;
/// Least |cosine| between the normals of the same wall seen twice.
constexpr double kMinNormalCosine = 0.8;
constexpr std::size_t kMinWallPoints = 50;
constexpr double kOverlapDistanceM = 0.8;
/// Metres that one radian counts, when directions of turning and shifting are compared.
constexpr double kCharacteristicLengthM = 10.0;
/// Deviation of a direction about which the registration says nothing.
constexpr double kUnknownSigmaM = 100.0;
/// Deviation towards a result that is about as good, in distances to it.
constexpr double kAmbiguousSigmas = 5.0;

/// Points that are looked up side by side.
constexpr std::size_t kLookups = 64;
/// Solutions that are nearer to each other while they are refined end as one.
constexpr double kJoinedM = 0.1;
constexpr double kJoinedRad = 0.5 * M_PI / 180.0;

void insert(const std::vector<PlacedCloud>& clouds, std::vector<Point> KeyframeCloud::*layer,
            matching::VoxelMap* map) {
  for (const PlacedCloud& placed : clouds) {
    std::vector<Eigen::Vector3d> positions;
    std::vector<float> intensities;
    for (const Point& point : (*placed.cloud).*layer) {
      positions.push_back(placed.T_submap_imu * point.position.cast<double>());
      intensities.push_back(point.intensity);
    }
    // The IMU stands for the lidar: only weights ask for the view, and nothing here for the lever.
    map->insert(positions, intensities, placed.T_submap_imu);
  }
}

}  // namespace

/// Both sides of a registration.
struct LoopVerifier::Scene {
  struct WallPoint {
    Eigen::Vector3d position;
    Eigen::Vector3d normal;
  };

  matching::VoxelMap planes;
  matching::VoxelMap edges;
  std::vector<Point> source_planes;
  std::vector<WallPoint> walls;  ///< of the source, with a normal of its own
  matching::MatchInput input;
};

struct LoopVerifier::Solution {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  matching::LidarInformation information;
  double score = 0.0;  ///< see wall_score
};

LoopVerifier::LoopVerifier(const Config& config) : config_(config.loop), matcher_(config) {
  plane_map_config_.voxel_size_m = config.mapping.map_voxel_m;
  plane_map_config_.min_points = static_cast<std::uint32_t>(config.mapping.plane_min_points);
  plane_map_config_.max_points = static_cast<std::uint32_t>(config.mapping.max_points_per_voxel);
  plane_map_config_.max_thickness_m = config.mapping.plane_max_thickness_m;
  edge_map_config_ = plane_map_config_;
  edge_map_config_.max_thickness_m = config.mapping.line_max_thickness_m;
}

LoopVerifier::Scene LoopVerifier::make_scene(const std::vector<PlacedCloud>& target,
                                             const std::vector<PlacedCloud>& source) const {
  Scene scene{matching::VoxelMap(plane_map_config_), matching::VoxelMap(edge_map_config_), {}, {}, {}};
  insert(target, &KeyframeCloud::planes, &scene.planes);
  insert(target, &KeyframeCloud::edges, &scene.edges);
  matching::VoxelMap source_map(plane_map_config_);
  insert(source, &KeyframeCloud::planes, &source_map);
  MapBuilder planes(config_.source_voxel_m);
  MapBuilder edges(0.5 * config_.source_voxel_m);
  for (const PlacedCloud& placed : source) {
    planes.add(placed.cloud->planes, placed.T_submap_imu);
    edges.add(placed.cloud->edges, placed.T_submap_imu);
  }
  scene.source_planes = planes.points();
  for (const Point& point : scene.source_planes) {
    const Eigen::Vector3d position = point.position.cast<double>();
    scene.input.planes.push_back(position);
    const matching::Cell* cell = source_map.find_plane(position, false);
    if (cell != nullptr && std::abs(cell->axes(2, 0)) <= kMaxWallNormalZ)
      scene.walls.push_back({position, cell->axes.col(0)});
  }
  for (const Point& point : edges.points()) scene.input.edges.push_back(point.position.cast<double>());
  return scene;
}

LoopCandidate LoopVerifier::verify(const std::vector<PlacedCloud>& target,
                                   const std::vector<PlacedCloud>& source,
                                   const RegistrationStart& start) const {
  const Scene scene = make_scene(target, source);
  std::vector<Solution> solutions;
  for (const Eigen::Isometry3d& T : search(scene, start)) {
    if (auto solution = refine(scene, T, start, solutions)) solutions.push_back(std::move(*solution));
  }
  const auto best = std::max_element(solutions.begin(), solutions.end(),
                                     [](const Solution& a, const Solution& b) { return a.score < b.score; });
  std::vector<Eigen::Vector3d> alternatives;
  for (const Solution& other : solutions) {
    const Eigen::Vector3d apart = other.T.translation() - best->T.translation();
    const Eigen::Vector3d moved_by = other.T.translation() - start.T_from_to.translation();
    if (moved_by.norm() > 3.5 * start.sigma_translation_m) continue;
    if (apart.norm() > kSameResultM && other.score > config_.ambiguity * best->score)
      alternatives.push_back(apart);
  }
  LoopCandidate candidate;
  candidate.measured.T_from_to = best->T;
  candidate.wall_points = scene.walls.size();
  candidate.wall_share = best->score;
  measure(scene, best->T, &candidate);
  set_information(*best, alternatives, &candidate);
  candidate.alternatives = alternatives;
  candidate.verdict = judge(candidate);
  return candidate;
}

std::optional<RelativePose> LoopVerifier::register_step(const std::vector<PlacedCloud>& target,
                                                        const std::vector<PlacedCloud>& source,
                                                        const Eigen::Isometry3d& T_start) const {
  const Scene scene = make_scene(target, source);
  const auto solution = refine(scene, T_start, {T_start, kStepSigmaM, kStepSigmaRad}, {});
  LoopCandidate candidate;
  candidate.measured.T_from_to = solution->T;
  candidate.wall_points = scene.walls.size();
  candidate.wall_share = solution->score;
  measure(scene, solution->T, &candidate);
  candidate.measured.information = covariance_of(*solution, &candidate).inverse();
  if (judge(candidate) != LoopVerdict::kPending) return std::nullopt;
  return candidate.measured;
}

/// Share of (at most `limit`) wall points of the source that lie on a wall of the map with the same normal;
/// nearer ones count more. The ground is left out, for it fits everywhere.
double LoopVerifier::wall_score(const Scene& scene, const Eigen::Isometry3d& T, std::size_t limit,
                                double distance_m) const {
  const std::size_t count = scene.walls.size();
  const std::size_t taken = std::min(count, limit);
  const Eigen::Matrix3d R = T.linear();
  double sum = 0.0;
  std::array<Eigen::Vector3d, kLookups> points;
  std::array<const matching::Cell*, kLookups> cells{};
  for (std::size_t first = 0; first < taken; first += kLookups) {
    const std::size_t size = std::min(kLookups, taken - first);
    for (std::size_t k = 0; k < size; ++k) points[k] = T * scene.walls[(first + k) * count / taken].position;
    scene.planes.find_planes(points.data(), size, false, cells.data());
    for (std::size_t k = 0; k < size; ++k) {
      if (cells[k] == nullptr) continue;
      const Eigen::Vector3d normal = cells[k]->axes.col(0);
      if (std::abs(normal.dot(R * scene.walls[(first + k) * count / taken].normal)) < kMinNormalCosine)
        continue;
      const double residual = normal.dot(points[k] - cells[k]->mean);
      sum += std::max(0.0, 1.0 - std::abs(residual) / distance_m);
    }
  }
  return taken == 0 ? 0.0 : sum / static_cast<double>(taken);
}

/// The prediction and the best places of a grid about it.
std::vector<Eigen::Isometry3d> LoopVerifier::search(const Scene& scene,
                                                    const RegistrationStart& start) const {
  struct Place {
    double score;
    Eigen::Isometry3d T;
  };
  std::vector<Place> places;
  const double radius = std::clamp(3.0 * start.sigma_translation_m, kMinSearchM, kMaxSearchM);
  const double turn = std::min(2.0 * start.sigma_rotation_rad, kMaxYawSearchRad);
  const int steps = static_cast<int>(std::ceil(radius / kGridStepM));
  const int turns = static_cast<int>(std::ceil(turn / kYawStepRad));
  for (int yaw = -turns; yaw <= turns; ++yaw) {
    for (int x = -steps; x <= steps; ++x) {
      for (int y = -steps; y <= steps; ++y) {
        Eigen::Isometry3d T = start.T_from_to;
        T.linear() = Eigen::AngleAxisd(yaw * kYawStepRad, Eigen::Vector3d::UnitZ()) * T.linear();
        T.translation() += kGridStepM * Eigen::Vector3d(x, y, 0.0);
        places.push_back({wall_score(scene, T, kScorePoints, 2.0 * kEndResidualM), T});
      }
    }
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.score > b.score; });
  const double predicted_score = wall_score(scene, start.T_from_to, kScorePoints, 2.0 * kEndResidualM);
  std::vector<Eigen::Isometry3d> starts = {start.T_from_to};
  const auto is_near = [](const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
    return (a.translation() - b.translation()).norm() < 1.5 * kGridStepM;
  };
  for (const Place& place : places) {
    if (starts.size() > kStarts) break;
    // Beside the prediction too, where that fits worse: a door frame may hold it.
    if (is_near(place.T, start.T_from_to) && place.score <= predicted_score) continue;
    const bool is_new = std::none_of(starts.begin() + 1, starts.end(),
                                     [&](const Eigen::Isometry3d& T) { return is_near(T, place.T); });
    if (is_new) starts.push_back(place.T);
  }
  return starts;
}

/// Gauss-Newton with the prediction as a weak prior, so that what the surfaces do not determine stays.
/// Nothing when it leads to one of the solutions `found`.
std::optional<LoopVerifier::Solution> LoopVerifier::refine(const Scene& scene,
                                                           const Eigen::Isometry3d& T_start,
                                                           const RegistrationStart& start,
                                                           const std::vector<Solution>& found) const {
  Matrix6d prior = Matrix6d::Zero();
  prior.diagonal().head<3>().setConstant(std::pow(start.sigma_rotation_rad, -2));
  prior.diagonal().tail<3>().setConstant(std::pow(start.sigma_translation_m, -2));
  Solution solution;
  solution.T = T_start;
  matching::MatchSettings settings;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    settings.wide = iteration < kWideIterations;
    if (!settings.wide && std::any_of(found.begin(), found.end(), [&solution](const Solution& other) {
          const Vector6d apart = difference(other.T, solution.T);
          return apart.head<3>().norm() < kJoinedRad && apart.tail<3>().norm() < kJoinedM;
        }))
      return std::nullopt;
    settings.max_residual_m =
        std::max(kEndResidualM, kStartResidualM * (1.0 - static_cast<double>(iteration) / kWideIterations));
    solution.information =
        matcher_.linearise(scene.input, scene.planes, scene.edges, Eigen::Quaterniond(solution.T.linear()),
                           solution.T.translation(), settings);
    if (solution.information.planes < kMinMatches) return solution;
    const Matrix6d H = solution.information.H + prior;
    const Vector6d b = solution.information.b + prior * difference(T_start, solution.T);
    const Vector6d step = -H.ldlt().solve(b);
    solution.T = moved(solution.T, step);
    if (!settings.wide && step.norm() < kConvergedM) break;
  }
  solution.score = wall_score(scene, solution.T, kRefinedScorePoints, kEndResidualM);
  return solution;
}

void LoopVerifier::measure(const Scene& scene, const Eigen::Isometry3d& T, LoopCandidate* candidate) const {
  std::size_t near = 0;
  std::size_t inliers = 0;
  double squared = 0.0;
  double sums[5] = {};  // of a, b, aa, bb, ab
  for (const Point& point : scene.source_planes) {
    const Eigen::Vector3d p = T * point.position.cast<double>();
    const matching::Cell* cell = scene.planes.find_plane(p, true);
    if (cell == nullptr) continue;
    const double residual = cell->axes.col(0).dot(p - cell->mean);
    if (std::abs(residual) > kOverlapDistanceM) continue;
    ++near;
    if (std::abs(residual) > kEndResidualM) continue;
    ++inliers;
    squared += residual * residual;
    const double a = std::log1p(std::max(0.0F, point.intensity));
    const double b = std::log1p(std::max(0.0F, cell->mean_intensity));
    sums[0] += a;
    sums[1] += b;
    sums[2] += a * a;
    sums[3] += b * b;
    sums[4] += a * b;
  }
  if (inliers == 0) return;
  const double n = static_cast<double>(inliers);
  candidate->overlap = static_cast<double>(near) / static_cast<double>(scene.source_planes.size());
  candidate->residual_m = std::sqrt(squared / n);
  const double variance_a = sums[2] / n - sums[0] * sums[0] / (n * n);
  const double variance_b = sums[3] / n - sums[1] * sums[1] / (n * n);
  // Without contrast (or without intensity) nothing disagrees.
  if (std::min(variance_a, variance_b) < 1e-6) {
    candidate->intensity_correlation = 1.0;
    return;
  }
  candidate->intensity_correlation =
      (sums[4] / n - sums[0] * sums[1] / (n * n)) / std::sqrt(variance_a * variance_b);
}

/// Covariance by direction. In a tangent space where a radian counts kCharacteristicLengthM, directions with
/// less than `weak_share` of the strongest one's information are those that noise alone would show: they
/// become unknown, and are counted in the candidate.
Matrix6d LoopVerifier::covariance_of(const Solution& solution, LoopCandidate* candidate) const {
  Vector6d scale;
  scale << Eigen::Vector3d::Constant(1.0 / kCharacteristicLengthM), Eigen::Vector3d::Ones();
  const Matrix6d scaled = scale.asDiagonal() * solution.information.H * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(0.5 * (scaled + scaled.transpose()));
  const double strongest = std::max(solver.eigenvalues()[5], 1e-12);
  Vector6d variances;
  for (int k = 0; k < 6; ++k) {
    const double eigenvalue = solver.eigenvalues()[k];
    const bool is_weak = eigenvalue < config_.weak_share * strongest;
    variances[k] = is_weak ? kUnknownSigmaM * kUnknownSigmaM : 1.0 / eigenvalue;
    candidate->weak_directions += is_weak ? 1 : 0;
  }
  const Matrix6d covariance =
      solver.eigenvectors() * variances.asDiagonal() * solver.eigenvectors().transpose();
  return scale.asDiagonal() * covariance * scale.asDiagonal();
}

/// Adds to the covariance what all loops share, and leaves the way to a result that is about as good unknown.
void LoopVerifier::set_information(const Solution& best, const std::vector<Eigen::Vector3d>& alternatives,
                                   LoopCandidate* candidate) const {
  Matrix6d covariance = covariance_of(best, candidate);
  const double sigma_rotation = config_.sigma_rotation_deg * M_PI / 180.0;
  covariance.diagonal().head<3>().array() += sigma_rotation * sigma_rotation;
  covariance.diagonal().tail<3>().array() += config_.sigma_translation_m * config_.sigma_translation_m;
  for (const Eigen::Vector3d& apart : alternatives) {
    const Eigen::Vector3d along = kAmbiguousSigmas * apart;
    covariance.bottomRightCorner<3, 3>() += along * along.transpose();
  }
  if (!alternatives.empty()) ++candidate->weak_directions;
  candidate->covariance = covariance;
  candidate->measured.information = covariance.inverse();
}

LoopVerdict LoopVerifier::judge(const LoopCandidate& candidate) const {
  if (candidate.overlap < config_.min_overlap) return LoopVerdict::kLowOverlap;
  if (candidate.wall_points < kMinWallPoints) return LoopVerdict::kNoInformation;
  if (candidate.wall_share < config_.min_wall_share) return LoopVerdict::kFewWalls;
  if (candidate.residual_m > config_.max_residual_m) return LoopVerdict::kHighResidual;
  if (candidate.intensity_correlation < config_.min_intensity_correlation)
    return LoopVerdict::kIntensityDisagrees;
  if (candidate.weak_directions >= 4) return LoopVerdict::kNoInformation;
  return LoopVerdict::kPending;
}

}  // namespace fdi_lio::mapping
