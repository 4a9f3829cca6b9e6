#include "fdi_lio/odometry/registration.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/matching/common_error.hpp"
#include "fdi_lio/matching/localizability.hpp"

namespace fdi_lio::odometry {

namespace {
/// Where the prediction of a scan is not to be relied on.
constexpr int kUnreliableIterations = 20;
constexpr double kUnreliableMaxResidual = 1.0;
/// Root mean square of the turn that points are deskewed wrongly by, in the turn that a gyro misses at some
/// instant of the scan, while it is taken for even: sqrt(1 / 6).
constexpr double kShear = 0.41;
/// Of the intensity features that find a texture in the map. Where it is less, those that do are a selection:
/// a cell takes three scans to know a texture, which few see that do not travel with the sensor.
constexpr double kUsualTextureShare = 0.1;
}  // namespace

Registration::Registration(const Config& config, Reporter* reporter)
    : config_(config.mapping),
      reporter_(reporter),
      matcher_(config),
      line_radius_(config.mapping.line_radius_m) {}

/// Directions that geometry leaves open are filled by textures. Without textures the chance information along
/// them, which is none, would be all that corrects the IMU: it is left alone there.
void Registration::add_directions(const matching::MatchInput& input, const matching::LocalMap& map,
                                  const imu::NavState& at, const matching::MatchSettings& settings,
                                  Alignment* alignment) const {
  const double margin = config_.localizability_margin;
  matching::LidarInformation* information = &alignment->information;
  const matching::Localizability geometric = matching::analyse_localizability(*information, margin);
  alignment->status.axes = geometric.axes;
  alignment->status.localizability = geometric.probability;
  alignment->axis_information = geometric.information;
  alignment->axis_noise = geometric.noise_information;
  matching::remove_bias(geometric, information);
  matching::LidarInformation trusted = *information;
  matching::soften(geometric, &trusted);
  alignment->trusted_information.surfaces = trusted.H.bottomRightCorner<3, 3>();
  if (!input.textures.empty()) {
    matching::LidarInformation textures =
        matcher_.linearise_textures(input, map.textures(), at.q_odom_imu, at.t_odom_imu, settings);
    matching::remove_bias(matching::analyse_localizability(textures, margin), &textures);
    matching::add_in_weak_directions(geometric, textures, information);
    const double share = static_cast<double>(textures.textures) / static_cast<double>(input.textures.size());
    textures.H *= std::min(1.0, std::pow(share / kUsualTextureShare, 2.0));
    matching::add_in_weak_directions(geometric, textures, &trusted);
  } else if (config_.soften_weak_directions && at.imu_status == imu::ImuStatus::kInitialised) {
    matching::soften(geometric, information);
  }
  alignment->trusted_information.all = trusted.H.bottomRightCorner<3, 3>();
}

/// A turn that the gyro missed was taken for even while the scan was deskewed.
void Registration::add_shear(const Expectation& expectation, const imu::NavState& predicted,
                             const imu::NavState& at, matching::LidarInformation* information) const {
  if (!expectation.missed_turn) return;
  const Eigen::Vector3d turn = *expectation.missed_turn +
                               so3::log(Eigen::Quaterniond(predicted.q_odom_imu.conjugate() * at.q_odom_imu));
  const double uneven_rad = std::min(turn.norm(), (turn - expectation.missed_turn_before).norm());
  matching::add_common_error(kShear * uneven_rad, information);
}

bool Registration::has_converged(const imu::NavState& before, const imu::NavState& after) const {
  const double turn = so3::log(Eigen::Quaterniond(before.q_odom_imu.conjugate() * after.q_odom_imu)).norm();
  const double step_m = (before.t_odom_imu - after.t_odom_imu).norm();
  return turn < config_.convergence_rotation_rad && step_m < config_.convergence_translation_m;
}

Alignment Registration::align(matching::MatchInput input, const matching::LocalMap& map,
                              const AdaptedSettings& adapted, std::size_t least_matches,
                              const Expectation& expectation, Smoother* smoother) {
  const bool is_unreliable = expectation.is_unreliable;
  const imu::NavState predicted = smoother->newest();
  const int iterations = is_unreliable ? kUnreliableIterations : adapted.iterations;
  matching::MatchSettings settings;
  settings.plane_weight = adapted.plane_weight;
  settings.edge_weight = adapted.edge_weight;
  settings.intensity_weight = config_.intensity_weight;
  settings.line_radius_m = line_radius_.mean_m();
  if (expectation.covariance) {
    input.plane_factors = matcher_.weigh_planes(input, map.planes(), predicted.q_odom_imu,
                                                predicted.t_odom_imu, *expectation.covariance);
  }
  Alignment alignment;
  matching::RadiusEvidence radius;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const imu::NavState current = smoother->newest();
    const double progress = static_cast<double>(iteration) / iterations;
    settings.max_residual_m =
        is_unreliable ? std::max(config_.max_residual_m, kUnreliableMaxResidual * (1.0 - progress))
                      : config_.max_residual_m;
    if (!is_unreliable && iteration > 0) settings.max_deviation = config_.max_deviation;
    matching::LidarInformation& information = alignment.information;
    information = matcher_.linearise(input, map.planes(), map.edges(), current.q_odom_imu, current.t_odom_imu,
                                     settings);
    radius = line_radius_.eliminate(&information);
    add_directions(input, map, current, settings, &alignment);
    alignment.status.iterations = static_cast<std::uint32_t>(iteration + 1);
    if (information.planes + information.edges < least_matches) {
      alignment.is_healthy = false;
      break;
    }
    add_shear(expectation, predicted, current, &information);
    smoother->set_lidar(information);
    if (!smoother->solve()) {
      reporter_->report(Severity::kError, "solver",
                        "the optimisation of a scan failed: its pose is a prediction");
      alignment.is_healthy = false;
      break;
    }
    if (has_converged(current, smoother->newest())) break;
  }
  // Before the IMU is initialised nothing tells a wrong velocity from a radius.
  if (alignment.is_healthy && expectation.covariance) line_radius_.learn(radius);
  return alignment;
}

}  // namespace fdi_lio::odometry
