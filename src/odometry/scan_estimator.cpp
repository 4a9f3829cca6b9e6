#include "fdi_lio/odometry/scan_estimator.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <sstream>
#include <string>
#include <utility>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/matching/match_input.hpp"
#include "fdi_lio/odometry/start_ground.hpp"
#include "fdi_lio/odometry/start_motion.hpp"

namespace fdi_lio::odometry {

namespace {

/// The first scans in a map, before a velocity is known well.
constexpr int kStartScans = 3;
constexpr double kLeastStartSpeed = 0.1;  ///< that the first two scans are deskewed with [m/s]
/// Way on which what is known of the beams' elevation is taken over into the scans [m].
constexpr double kElevationWay = 20.0;
constexpr double kBeamsOfSigma = 16.0;  ///< that mapping.common_elevation_sigma holds for

Smoother::CalibrationSigma calibration_sigma(const Config& config) {
  Smoother::CalibrationSigma sigma;
  if (config.mapping.estimate_mounting) sigma.mounting_rad = config.sensor.mounting_sigma_deg * M_PI / 180.0;
  if (config.mapping.estimate_time_offset)
    sigma.lidar_time_offset_s = config.sensor.lidar_time_offset_sigma_s;
  if (config.mapping.estimate_gyro_scale) {
    sigma.gyro_scale = config.sensor.gyro_scale_sigma;
    sigma.gyro_lean = config.sensor.gyro_lean_sigma_deg * M_PI / 180.0;
  }
  return sigma;
}

/// The mean of errors of so many beams.
double common_elevation_sigma(const FeatureSet& features, double sigma_rad) {
  double beams = 1.0;
  for (const Point& point : features.planes) beams = std::max(beams, 1.0 + point.ring);
  return sigma_rad * std::sqrt(kBeamsOfSigma / beams);
}

}  // namespace

ScanEstimator::ScanEstimator(const Config& config, Reporter* reporter, const StageTimer& timer)
    : config_(config),
      reporter_(reporter),
      timer_(timer),
      T_imu_lidar_(config.sensor.T_imu_lidar()),
      smoother_(config.mapping.window_size, config.sensor.gravity_mps2, calibration_sigma(config),
                config.mapping.tilt_walk_deg * M_PI / 180.0),
      map_(config.mapping),
      stated_(config),
      calibration_report_(config.sensor, reporter),
      candidate_(config),
      imu_start_(config, reporter),
      beams_(config),
      brightness_(T_imu_lidar_),
      shock_guard_(config.sensor.shock_acceleration_mps2, reporter),
      aligner_(config, &shock_guard_, reporter) {}

ScanEstimator::~ScanEstimator() { learning_.wait(); }

std::optional<imu::NavState> ScanEstimator::state() const {
  if (smoother_.empty()) return std::nullopt;
  return smoother_.newest();
}

std::vector<Point> ScanEstimator::local_map() {
  learning_.wait();
  return map_.points();
}

std::size_t ScanEstimator::map_voxel_count() {
  learning_.wait();
  return map_.cell_count();
}

void ScanEstimator::start(const FeatureSet& features, const std::optional<imu::Preintegration>& imu) {
  if (config_.mapping.calibrate_beams) {
    common_elevation_sigma_rad_ =
        common_elevation_sigma(features, config_.mapping.common_elevation_sigma_deg * M_PI / 180.0);
  }
  if (resumed_ && resumed_->stamp == features.stamp) {
    Smoother::InitialSigma sigma;
    sigma.velocity = 0.5;
    sigma.gyro_bias = 2e-3;
    sigma.gravity = 0.02;
    start_smoother(*resumed_, sigma);
    reporter_->report(Severity::kInfo, "resumed",
                      "mapping goes on from the newest estimate before its restart");
    return;
  }
  imu::NavState first;
  first.stamp = features.stamp;
  first.g_odom = Eigen::Vector3d(0.0, 0.0, -config_.sensor.gravity_mps2);
  if (imu) first.q_odom_imu = imu::level_orientation(imu->recent);
  first.imu_status = imu ? imu::ImuStatus::kInitialising : imu::ImuStatus::kNone;
  if (!imu) {
    reporter_->report(
        Severity::kWarning, "lidar_only",
        "no IMU data: the motion is predicted by constant velocity; sensor.imu_topic names the topic");
  }
  if (moving_start_) {
    const ImuStart::Found found = imu_start_.moving(first, *moving_start_);
    start_smoother(found.state, found.sigma);
    return;
  }
  start_smoother(first, Smoother::InitialSigma());
  if (imu) ground_normal_ = find_ground(features, first.q_odom_imu * T_imu_lidar_.linear());
}

void ScanEstimator::predict(const FeatureSet& features, const std::optional<imu::Preintegration>& imu) {
  const imu::NavState& newest = smoother_.newest();
  const bool has_imu = imu && imu->sample_count > 0 && imu->from == newest.stamp && imu->to == features.stamp;
  if (!has_imu) {
    if (newest.imu_status != imu::ImuStatus::kNone) {
      reporter_->report(
          Severity::kWarning, "imu_missing",
          "no IMU data for the interval before a scan: its motion is predicted by constant velocity");
    }
    const imu::Preintegration motion = imu::constant_velocity(newest, features.stamp, config_.imu);
    smoother_.add(imu::predict_without_gravity(newest, motion), motion, false, Eigen::Vector3d::Zero());
    return;
  }
  if (newest.imu_status == imu::ImuStatus::kInitialised) {
    const imu::NavState predicted = imu::predict(newest, *imu);
    const double error_mps = shock_guard_.add((predicted.v_odom - newest.v_odom).norm(), imu->duration_s());
    smoother_.add(predicted, imu::with_error(*imu, {shock_guard_.doubtful_turn().norm(), error_mps}), true,
                  bend_to(predicted));
    return;
  }
  const imu::Preintegration motion = imu::gyro_only(*imu, config_.imu);
  imu::NavState predicted = imu::predict_without_gravity(newest, motion);
  predicted.imu_status = imu::ImuStatus::kInitialising;
  smoother_.add(predicted, motion, false, Eigen::Vector3d::Zero());
}

/// At a start in motion nothing predicts the second scan, and neither it nor the first was deskewed.
void ScanEstimator::search_motion(const FeatureSet& first, const std::optional<imu::Preintegration>& imu,
                                  FeatureSet* features) {
  const bool is_calm = imu && imu::is_calm(imu->recent, config_.imu);
  const std::optional<StartVelocity> found =
      start_velocity(first, before_, *features, smoother_.newest(), is_calm, T_imu_lidar_);
  if (!found) return;
  has_found_motion_ = found->is_clear;
  begin_with_velocity(found->v_odom, first, imu, features);
}

/// Two scans that were deskewed alike, or not at all, match at their true distance. The third, deskewed with
/// the velocity so told, would not fit a map of them: it deskews both anew. Returns whether there is any.
bool ScanEstimator::adopt_motion(const FeatureSet& first, const std::optional<imu::Preintegration>& imu,
                                 FeatureSet* features) {
  const Eigen::Vector3d v_odom = smoother_.newest().v_odom;
  if (v_odom.norm() < kLeastStartSpeed) return false;
  begin_with_velocity(v_odom, first, imu, features);
  return true;
}

/// The map anew of the first scan, and the prediction of the second, both of a sensor that moves. `features`
/// of the second are deskewed with the velocity that the first had until now.
void ScanEstimator::begin_with_velocity(const Eigen::Vector3d& v_odom, const FeatureSet& first,
                                        const std::optional<imu::Preintegration>& imu, FeatureSet* features) {
  imu::NavState more = smoother_.newest();
  more.v_odom = v_odom - before_.v_odom;
  *features = moved_while_scanned(std::move(*features), more, T_imu_lidar_);
  before_.v_odom = v_odom;
  map_ = matching::LocalMap(config_.mapping);
  map_.insert(moved_while_scanned(first, before_, T_imu_lidar_), before_.T_odom_imu(), T_imu_lidar_);
  start_smoother(before_, Smoother::InitialSigma());
  predict(*features, imu);
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "started in motion, at about " << v_odom.norm()
       << " m/s by the first two scans";
  reporter_->report(Severity::kInfo, "first_motion", text.str());
}

/// Where the map knows nothing of the scans, but they know each other, they become the local map, and what
/// the prediction may be off by becomes an uncertainty that stays.
void ScanEstimator::begin_map_anew(const EstimateResult& result, const Matrix15d& covariance) {
  const auto largest = [&covariance](int block) {
    return std::sqrt(covariance.diagonal().segment<3>(3 * block).maxCoeff());
  };
  Smoother::InitialSigma sigma;
  sigma.velocity = std::clamp(largest(2), 0.05, 10.0);
  sigma.gyro_bias = std::clamp(largest(3), 1e-4, 0.02);
  sigma.accel_bias = std::clamp(largest(4), 1e-3, 0.3);
  sigma.gravity = 0.02;
  reporter_->report(Severity::kError, "map_restart",
                    "the scans match hardly anything in the local map (" +
                        std::to_string(result.status.matched) +
                        " matches): a new one is begun at the predicted pose, with " +
                        std::to_string(result.state.v_odom.norm()) +
                        " m/s, whose error remains. After a long gap without scans this is as it should be; "
                        "otherwise check sensor.T_imu_lidar and the clocks");
  start_smoother(result.state, sigma);
  stated_.begin_map_anew(result.map_covariance);
  map_ = candidate_.take();
  imu_start_.reset();
  ground_normal_.reset();
  aligner_.begin_map_anew();
  map_scans_ = 0;
  has_restarted_ = true;
}

void ScanEstimator::adopt_imu(const std::optional<ImuStart::Found>& found) {
  if (!found) return;
  start_smoother(found->state, found->sigma);
  imu_start_.reset();
}

void ScanEstimator::start_smoother(const imu::NavState& state, Smoother::InitialSigma sigma) {
  sigma.beam_elevation = common_elevation_sigma_rad_;
  smoother_.start(state, sigma);
  // At rest gravity and bias are tied: it does not matter which of them is off.
  brightness_.reset(sigma.velocity, sigma.rest_acceleration > 0.0 ? 0.0 : sigma.gravity);
}

/// Of the map on the step from the newest state to `predicted`; nothing while no features tell its size.
Eigen::Vector3d ScanEstimator::bend_to(const imu::NavState& predicted) const {
  if (radius_m_ <= 0.0) return Eigen::Vector3d::Zero();
  const imu::NavState& newest = smoother_.newest();
  const Eigen::Vector3d step_m = newest.q_odom_imu.conjugate() * (predicted.t_odom_imu - newest.t_odom_imu);
  return map_bend(T_imu_lidar_.linear().col(2), step_m, radius_m_);
}

/// The part of the common elevation that the beams have to take over. Not all at once: what is known of it
/// still changes, and the map was made without.
double ScanEstimator::take_out_beam_elevation() {
  const imu::NavState& newest = smoother_.newest();
  const double way_m = (newest.t_odom_imu - before_.t_odom_imu).norm();
  const double part = std::min(1.0, way_m / kElevationWay) * newest.beam_elevation;
  smoother_.reduce_beam_elevation(part);
  return part;
}

void ScanEstimator::learn(FeatureSet features, const EstimateResult& result) {
  // A gyro that misses a turn deskews badly, too.
  const bool is_of_use = result.is_healthy && !shock_guard_.is_gyro_doubtful();
  const bool is_settled = is_of_use && result.state.imu_status == imu::ImuStatus::kInitialised;
  const bool teaches_beams = config_.mapping.calibrate_beams && is_settled;
  const double elevation = teaches_beams ? take_out_beam_elevation() : 0.0;
  const bool enters_map = is_of_use || map_.empty();
  learning_.run([=, state = result.state, features = std::move(features)] {
    const auto begin = std::chrono::steady_clock::now();
    if (teaches_beams) {
      beams_.learn(features, state, map_.planes());
      beams_.add_common_elevation(elevation);
    }
    if (enters_map) map_.insert(features, state.T_odom_imu(), T_imu_lidar_);
    learning_ms_ =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  });
}

bool ScanEstimator::decide_keyframe(bool is_reviewed) {
  const Eigen::Isometry3d T = smoother_.newest().T_odom_imu();
  const Eigen::Isometry3d T_keyframe_now = T_odom_keyframe_.inverse() * T;
  const double rotation = so3::log(Eigen::Matrix3d(T_keyframe_now.rotation())).norm();
  const double motion =
      T_keyframe_now.translation().norm() + config_.mapping.keyframe_rotation_weight_m_per_rad * rotation;
  const bool is_open =
      is_reviewed && (moving_start_ || smoother_.newest().imu_status != imu::ImuStatus::kInitialised);
  const bool is_sheared = shock_guard_.is_gyro_doubtful();
  if (is_sheared || (has_keyframe_ ? motion <= adapted_.keyframe_distance_m : is_open)) return false;
  T_odom_keyframe_ = T;
  has_keyframe_ = true;
  return true;
}

/// What the newest scan is to be deskewed with (in `odom`), instead of `v_deskew`, which it was deskewed
/// with.
Eigen::Vector3d ScanEstimator::deskew_velocity(const Eigen::Vector3d& v_deskew, bool is_reviewed) const {
  const imu::NavState& newest = smoother_.newest();
  // While scans alone tell the velocity, as after a shock, one that is wrong by d shifts what is seen at the
  // beginning of a sweep by d times its duration, so that the next are wrong by d_k = d_k-1 - d_k-2, which
  // oscillates for ever. With the mean of the last two, d_k = (d_k-1 - d_k-3) / 2, which fades.
  const bool is_by_scans = newest.imu_status != imu::ImuStatus::kInitialised || shock_guard_.is_shocked();
  if (is_by_scans && scan_count_ > 1) return 0.5 * (before_.v_odom + v_earlier_);
  return moving_start_ && is_reviewed ? newest.v_odom : v_deskew;
}

/// With `v_odom` instead of `v_before`.
FeatureSet ScanEstimator::deskewed_anew(FeatureSet features, const Eigen::Vector3d& v_before,
                                        const Eigen::Vector3d& v_odom) const {
  if (v_odom == v_before) return features;
  imu::NavState state = smoother_.newest();
  state.v_odom = v_odom - v_before;
  return moved_while_scanned(std::move(features), state, T_imu_lidar_);
}

/// The newest scan against the map: its pose, and what was matched.
void ScanEstimator::match(const FeatureSet& features, const std::optional<imu::Preintegration>& imu,
                          EstimateResult* result) {
  const bool is_known = smoother_.newest().imu_status == imu::ImuStatus::kInitialised && !has_restarted_;
  const bool is_unpredicted = map_scans_ <= kStartScans && !is_known && !moving_start_;
  const Alignment alignment =
      aligner_.align({features, imu, before_, map_, adapted_, is_unpredicted}, &smoother_);
  trusted_information_ = alignment.trusted_information;
  const matching::LidarInformation& information = alignment.information;
  radius_m_ = information.radius_m;
  result->is_healthy = alignment.is_healthy;
  result->axis_information = alignment.axis_information;
  result->axis_noise = alignment.axis_noise;
  result->matched_planes = information.planes;
  result->matched_edges = information.edges;
  result->matched_textures = information.textures;
  result->status = alignment.status;
  const std::size_t matched = information.planes + 2 * information.edges;
  result->status.matched = static_cast<std::uint32_t>(matched);
  if (matched > 0)
    result->status.residual_rms_m = std::sqrt(information.squared_error / static_cast<double>(matched));
}

/// The angular velocity of the newest state, and the IMU's start where one is found.
void ScanEstimator::take_up_imu(const std::optional<imu::Preintegration>& imu) {
  const imu::NavState& newest = smoother_.newest();
  const double dt = seconds_between(before_.stamp, newest.stamp);
  const bool has_imu = imu && imu->sample_count > 0;
  // Without an IMU the angular velocity is the mean of the last interval.
  const Eigen::Vector3d w_imu =
      has_imu ? newest.errors().angular_velocity(imu->last_angular_velocity)
              : Eigen::Vector3d(
                    so3::log(Eigen::Quaterniond(before_.q_odom_imu.conjugate() * newest.q_odom_imu)) / dt);
  smoother_.annotate_newest(newest.imu_status, w_imu);
  if (!has_imu || newest.imu_status == imu::ImuStatus::kInitialised) return;
  if (const std::optional<ImuStart::Found> rest = imu_start_.at_rest(smoother_.newest(), *imu)) {
    seems_to_stand_ = true;
    adopt_imu(rest);
    return;
  }
  const std::optional<ImuStart::Found> found =
      imu_start_.in_motion(before_, smoother_.newest(), *imu, ground_normal_);
  const bool is_of_all = static_cast<int>(imu_start_.interval_count()) == scan_count_;
  if (found && is_of_all && !has_restarted_) aligned_start_ = found->start;
  adopt_imu(found);
}

/// Brightness corrects the velocity where nothing else holds it.
void ScanEstimator::watch_velocity(const FeatureSet& features, const Eigen::Vector3d& v_deskew) {
  const imu::NavState& newest = smoother_.newest();
  const bool is_watched = config_.mapping.use_intensity && config_.mapping.watch_velocity;
  if (!is_watched || newest.imu_status != imu::ImuStatus::kInitialised) return;
  const auto correction = brightness_.add(features, v_deskew, newest, trusted_information_);
  if (!correction) return;
  smoother_.shift(correction->velocity, correction->acceleration);
  std::ostringstream text;
  text << std::fixed << std::setprecision(2)
       << "surfaces do not hold the velocity: the brightness of what passes by corrects it, by "
       << correction->velocity.norm() << " m/s";
  reporter_->report(Severity::kInfo, "brightness_velocity", text.str());
}

/// What the newest state may be off by: against the local map, and since the start.
void ScanEstimator::state_uncertainty(const Matrix15d& covariance, EstimateResult* result) {
  result->map_covariance = covariance.topLeftCorner<6, 6>();
  if (scan_count_ == 0) {
    stated_.begin(result->state);
  } else {
    stated_.advance(before_, result->state, result->map_covariance, radius_m_);
  }
  result->covariance = stated_.covariance(result->state, result->map_covariance, adapted_.noise_scale,
                                          brightness_.position_covariance());
  result->velocity_covariance = covariance.block<3, 3>(6, 6) + brightness_.velocity_covariance();
}

/// A scan that matched nothing may be the first of a map to come. Returns whether that map has been begun.
bool ScanEstimator::review_map(const FeatureSet& features, const EstimateResult& result,
                               const Matrix15d& covariance) {
  if (result.is_healthy) {
    candidate_.reset();
    return false;
  }
  reporter_->report(Severity::kWarning, "no_match",
                    "a scan has too few matches with the map (" + std::to_string(result.status.matched) +
                        "): its pose is a prediction");
  const matching::MatchInput input =
      matching::make_match_input(features, config_.mapping, T_imu_lidar_, adapted_.feature_voxel_m);
  if (!candidate_.add(features, input, result.state)) return false;
  begin_map_anew(result, covariance);
  return true;
}

std::optional<EstimateResult> ScanEstimator::add(EstimatorInput input, bool is_reviewed) {
  const std::optional<imu::Preintegration>& imu = input.imu;
  if (!smoother_.empty() && input.features.stamp <= smoother_.newest().stamp) {
    reporter_->report(Severity::kWarning, "scan_order",
                      "a scan whose stamp does not follow the one before was dropped");
    return std::nullopt;
  }
  learning_.wait();
  if (scan_count_ > 0) timer_.note("learning", learning_ms_);
  adapted_ = adapt(config_.adaptation, config_.mapping, input.degeneracy);
  EstimateResult result;
  FeatureSet features = std::move(input.features);
  const bool is_first = smoother_.empty();
  std::optional<FeatureSet> first;  // where this scan is the second, and nothing tells the velocity yet
  if (is_first) {
    start(features, imu);
  } else {
    v_earlier_ = before_.v_odom;
    before_ = smoother_.newest();
    predict(features, imu);
    first = std::exchange(first_, std::nullopt);
    if (first) search_motion(*first, imu, &features);
  }
  const Eigen::Vector3d v_deskew = deskew_velocity(input.v_deskew, is_reviewed);
  features = deskewed_anew(std::move(features), input.v_deskew, v_deskew);
  if (!is_first) {
    if (config_.mapping.calibrate_beams) features = beams_.apply(std::move(features), smoother_.newest());
    match(features, imu, &result);
    const bool is_unknown = first && !has_found_motion_ && result.is_healthy;
    if (is_unknown && adopt_motion(*first, imu, &features)) match(features, imu, &result);
    take_up_imu(imu);
    if (result.is_healthy) watch_velocity(features, v_deskew);
  }
  result.state = smoother_.newest();
  result.status.stamp = features.stamp;
  calibration_report_.add(result.state, imu ? imu->recent : imu::ImuStatistics());
  const Matrix15d covariance = smoother_.covariance();
  state_uncertainty(covariance, &result);
  const bool is_restart = review_map(features, result, covariance);
  // Whoever knows a state from before deskews with it.
  if (scan_count_ == 0 && !resumed_ && !moving_start_) first_ = features;
  learn(std::move(features), result);
  result.is_keyframe = decide_keyframe(is_reviewed) || is_restart;
  if (result.is_keyframe && result.state.imu_status == imu::ImuStatus::kInitialised)
    result.gravity = smoother_.gravity();
  ++map_scans_;
  ++scan_count_;
  return result;
}

}  // namespace fdi_lio::odometry
