#include "fdi_lio/mapping/gnss_aligner.hpp"

#include <algorithm>
#include <cmath>

#include <GeographicLib/LocalCartesian.hpp>

namespace fdi_lio::mapping {

namespace {

/// Fixes that an alignment is looked for in: the newest, so that drift stays small and cost bounded.
constexpr std::size_t kMaxWaiting = 100;
/// Pairs of fixes that are tried for the heading of the map.
constexpr std::size_t kMaxPairs = 2000;
/// Of heights that are not used: the factor says nothing about them.
constexpr double kUnusedHeightInformation = 0.0;

double horizontal_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return (a - b).head<2>().norm();
}

}  // namespace

class GnssAligner::Origin {
 public:
  explicit Origin(const GnssFix& fix) : local_(fix.latitude_deg, fix.longitude_deg, fix.altitude_m) {}

  GeodeticPoint point() const {
    return {local_.LatitudeOrigin(), local_.LongitudeOrigin(), local_.HeightOrigin()};
  }

  Eigen::Vector3d to_enu(const GnssFix& fix) const {
    Eigen::Vector3d p;
    local_.Forward(fix.latitude_deg, fix.longitude_deg, fix.altitude_m, p.x(), p.y(), p.z());
    return p;
  }

 private:
  GeographicLib::LocalCartesian local_;
};

const char* to_text(GnssVerdict verdict) {
  static constexpr const char* kTexts[] = {"accepted", "waiting", "no_fix", "poor_covariance", "outlier"};
  return kTexts[static_cast<int>(verdict)];
}

GnssAligner::GnssAligner(const GnssConfig& config, double drift_share)
    : config_(config), drift_share_(drift_share) {}
GnssAligner::~GnssAligner() = default;

std::optional<GeodeticPoint> GnssAligner::origin() const {
  if (!origin_) return std::nullopt;
  return origin_->point();
}

GnssVerdict GnssAligner::add(const GnssFix& fix, const TiedFix& tied,
                             const std::optional<EnuAlignment>& alignment, PositionFix* position) {
  const bool is_number =
      std::isfinite(fix.latitude_deg) && std::isfinite(fix.longitude_deg) && std::isfinite(fix.altitude_m);
  if (fix.status < 0 || !is_number || std::abs(fix.latitude_deg) > 90.0) return GnssVerdict::kNoFix;
  const double said = fix.has_covariance ? std::sqrt(0.5 * (fix.covariance(0, 0) + fix.covariance(1, 1)))
                                         : config_.default_sigma_m;
  if (!(said <= config_.max_sigma_m)) return GnssVerdict::kPoorCovariance;
  const double sigma_m = std::max(said, config_.min_sigma_m);
  const double vertical_m =
      std::max(fix.has_covariance ? std::sqrt(fix.covariance(2, 2)) : 2.0 * sigma_m, config_.min_sigma_m);
  if (!origin_) origin_ = std::make_unique<Origin>(fix);
  position->node = tied.node;
  position->p_imu = tied.p_imu;
  position->p_enu = origin_->to_enu(fix);
  position->information = Eigen::Matrix3d::Zero();
  position->information.diagonal().head<2>().setConstant(std::pow(sigma_m, -2));
  position->information(2, 2) = config_.use_altitude ? std::pow(vertical_m, -2) : kUnusedHeightInformation;
  if (!alignment) {
    waiting_.push_back({tied, *position, sigma_m});
    if (waiting_.size() > kMaxWaiting) waiting_.erase(waiting_.begin());
    return GnssVerdict::kWaiting;
  }
  const double drift_m = drift_share_ * (tied.path_m - accepted_at_m_);
  const double off_m = horizontal_distance(alignment->T_enu_map() * tied.p_map, position->p_enu);
  if (off_m > config_.max_deviation * std::hypot(sigma_m, drift_m)) return GnssVerdict::kOutlier;
  accepted_at_m_ = tied.path_m;
  return GnssVerdict::kAccepted;
}

double GnssAligner::extent_m() const {
  double extent = 0.0;
  for (const Waiting& other : waiting_)
    extent = std::max(extent, horizontal_distance(other.tied.p_map, waiting_.front().tied.p_map));
  return extent;
}

EnuAlignment GnssAligner::from_pair(const Waiting& a, const Waiting& b) const {
  const Eigen::Vector3d in_map = b.tied.p_map - a.tied.p_map;
  const Eigen::Vector3d in_enu = b.position.p_enu - a.position.p_enu;
  EnuAlignment alignment;
  alignment.yaw_rad = std::atan2(in_enu.y(), in_enu.x()) - std::atan2(in_map.y(), in_map.x());
  const Eigen::Vector3d middle_map = 0.5 * (a.tied.p_map + b.tied.p_map);
  const Eigen::Vector3d middle_enu = 0.5 * (a.position.p_enu + b.position.p_enu);
  alignment.t_enu_map = middle_enu - alignment.T_enu_map().linear() * middle_map;
  return alignment;
}

std::vector<std::size_t> GnssAligner::inliers_of(const EnuAlignment& alignment) const {
  const Eigen::Isometry3d T_enu_map = alignment.T_enu_map();
  std::vector<std::size_t> inliers;
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const double off_m = horizontal_distance(T_enu_map * waiting_[k].tied.p_map, waiting_[k].position.p_enu);
    if (off_m <= config_.max_deviation * waiting_[k].sigma_m) inliers.push_back(k);
  }
  return inliers;
}

/// Least squares over the plane (Umeyama without scale), and the mean of the heights.
EnuAlignment GnssAligner::fit(const std::vector<std::size_t>& inliers) const {
  Eigen::Vector3d mean_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_enu = Eigen::Vector3d::Zero();
  for (const std::size_t k : inliers) {
    mean_map += waiting_[k].tied.p_map / static_cast<double>(inliers.size());
    mean_enu += waiting_[k].position.p_enu / static_cast<double>(inliers.size());
  }
  double cosine = 0.0;
  double sine = 0.0;
  for (const std::size_t k : inliers) {
    const Eigen::Vector3d a = waiting_[k].tied.p_map - mean_map;
    const Eigen::Vector3d b = waiting_[k].position.p_enu - mean_enu;
    cosine += a.x() * b.x() + a.y() * b.y();
    sine += a.x() * b.y() - a.y() * b.x();
  }
  EnuAlignment alignment;
  alignment.yaw_rad = std::atan2(sine, cosine);
  alignment.t_enu_map = mean_enu - alignment.T_enu_map().linear() * mean_map;
  return alignment;
}

std::optional<EnuAlignment> GnssAligner::try_align(std::vector<PositionFix>* positions) {
  const std::size_t count = waiting_.size();
  if (count < static_cast<std::size_t>(config_.align_fixes) || extent_m() < config_.align_distance_m)
    return std::nullopt;
  std::vector<std::size_t> best;
  const std::size_t stride = std::max<std::size_t>(1, count * (count - 1) / 2 / kMaxPairs);
  std::size_t pair = 0;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = i + 1; j < count; ++j) {
      if (pair++ % stride != 0) continue;
      if (horizontal_distance(waiting_[i].tied.p_map, waiting_[j].tied.p_map) <
          0.5 * config_.align_distance_m)
        continue;
      const std::vector<std::size_t> inliers = inliers_of(from_pair(waiting_[i], waiting_[j]));
      if (inliers.size() > best.size()) best = inliers;
    }
  }
  if (static_cast<double>(best.size()) < config_.align_inliers * static_cast<double>(count))
    return std::nullopt;
  const EnuAlignment alignment = fit(best);
  const std::vector<std::size_t> inliers = inliers_of(alignment);
  for (const std::size_t k : inliers) positions->push_back(waiting_[k].position);
  accepted_at_m_ = waiting_.back().tied.path_m;
  waiting_.clear();
  return alignment;
}

}  // namespace fdi_lio::mapping
