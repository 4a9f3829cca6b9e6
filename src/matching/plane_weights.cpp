#include "fdi_lio/matching/plane_weights.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "fdi_lio/common/key_index.hpp"

namespace fdi_lio::matching {

namespace {

/// Plane matches are judged together within cubes of this size [m].
constexpr double kPatchSize = 2.0;
/// Within cubes of this size [m] planes share errors.
constexpr double kShareSize = 10.0;
/// What a patch's mean may deviate by beyond the prediction's error, as a share of the deviation of one
/// point: beams and surfaces have errors that averaging does not take away.
constexpr double kPatchFloor = 0.25;
/// The prediction's own deviations of position count twice: they know nothing of the errors that scans and
/// map share. Those of rotation count four times: clocks and mountings are not known as well as stated,
/// either.
constexpr double kPositionFactor = 2.0;
constexpr double kRotationFactor = 4.0;

/// A patch is condemned that has less trust: more than a deviation off.
constexpr double kCondemned = 0.25;
/// A prediction that condemns a larger share of a scan's planes is doubted: traffic, walkers and what is
/// wrong in the map are 0.15 at most, mostly below 0.05.
constexpr double kMostCondemned = 0.2;
/// It is wrong if some other pose condemns less than this share of what it condemns.
constexpr double kAgreed = 0.5;
constexpr int kConsensusRounds = 5;
/// The prediction keeps the directions that the scan does not tell.
constexpr double kDoubtedPrediction = 1e4;  ///< times its covariance
constexpr double kLeastVariance = 1e-12;    ///< keeps its inverse regular [rad^2, m^2]

/// Mean residual of the plane matches of one part of the scan.
class Patch {
 public:
  void add(const PlaneMatch& match) {
    const double weight = 1.0 / match.variance;
    weight_ += weight;
    residual_ += weight * match.residual_m;
    jacobian_ += weight * match.jacobian;
    ++count_;
  }

  /// With the pose moved by `step` from the prediction: 1 where the mean is what the pose's covariance and
  /// chance allow, a quarter where it is one deviation of these, towards 0 beyond.
  double trust(const TrustInput& input, const Vector6d& step) const {
    const double mean = (residual_ + jacobian_.dot(step)) / weight_;
    Vector6d J = jacobian_ / weight_;
    J.head<3>() *= kRotationFactor;
    J.tail<3>() *= kPositionFactor;
    const double variance = input.correlation_factor / weight_ +
                            kPatchFloor * kPatchFloor * input.point_variance + J.dot(input.covariance * J);
    const double excess = 1.0 + mean * mean / variance;
    return 1.0 / (excess * excess);
  }

  /// Adds what the mean tells of the step, `trust` times.
  void add_to(double trust, const TrustInput& input, Matrix6d* H, Vector6d* b) const {
    const double scale = trust / (weight_ * input.correlation_factor);
    *H += scale * jacobian_ * jacobian_.transpose();
    *b += scale * residual_ * jacobian_;
  }

  std::size_t count() const { return count_; }

 private:
  double weight_ = 0.0;
  double residual_ = 0.0;
  Vector6d jacobian_ = Vector6d::Zero();
  std::size_t count_ = 0;
};

/// Trust in patches, at one pose.
struct Judgement {
  std::vector<float> trust;
  double condemned = 0.0;  ///< share of the planes
};

Judgement judge(const std::vector<Patch>& patches, const TrustInput& input, const Vector6d& step) {
  Judgement judgement;
  judgement.trust.reserve(patches.size());
  std::size_t all = 0;
  std::size_t condemned = 0;
  for (const Patch& patch : patches) {
    const double trust = patch.trust(input, step);
    judgement.trust.push_back(static_cast<float>(trust));
    all += patch.count();
    if (trust < kCondemned) condemned += patch.count();
  }
  if (all > 0) judgement.condemned = static_cast<double>(condemned) / static_cast<double>(all);
  return judgement;
}

/// The judgement at the pose that most patches agree on, found from all of them by reweighting.
Judgement consensus(const std::vector<Patch>& patches, const TrustInput& input) {
  const Matrix6d covariance = kDoubtedPrediction * input.covariance + kLeastVariance * Matrix6d::Identity();
  const Matrix6d prior = covariance.inverse();
  Judgement judgement;
  judgement.trust.assign(patches.size(), 1.0F);
  for (int round = 0; round < kConsensusRounds; ++round) {
    Matrix6d H = prior;
    Vector6d b = Vector6d::Zero();
    for (std::size_t k = 0; k < patches.size(); ++k)
      patches[k].add_to(static_cast<double>(judgement.trust[k]), input, &H, &b);
    judgement = judge(patches, input, -H.ldlt().solve(b));
  }
  return judgement;
}

/// The group of a plane: the cube of `size_m` that it lies in, and the signed axis that its normal is nearest
/// to.
std::uint64_t group_key(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& normal, double size_m) {
  Eigen::Index nearest = 0;
  normal.cwiseAbs().maxCoeff(&nearest);
  auto key = static_cast<std::uint64_t>(2 * nearest + (normal[nearest] > 0.0 ? 1 : 0));
  for (int axis = 0; axis < 3; ++axis) {
    const auto cell = static_cast<std::int64_t>(std::floor(p_imu[axis] / size_m));
    key = (key << 20) | (static_cast<std::uint64_t>(cell) & 0xfffff);
  }
  return key;
}

/// Planes of a scan that are near each other and face alike.
struct Groups {
  std::vector<std::uint32_t> of_plane;  ///< number of the group; of planes without a match any
  std::size_t count = 0;
};

/// `is_signed`: apart by the sign of the normal, too, which the cells' principal axes have by chance.
Groups group_planes(const std::vector<Eigen::Vector3d>& planes, const PlaneMatches& matches, double size_m,
                    bool is_signed) {
  KeyIndex numbers;
  Groups groups;
  groups.of_plane.resize(planes.size(), 0);
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (!matches[i]) continue;
    const Eigen::Vector3d normal = is_signed ? matches[i]->normal : matches[i]->normal.cwiseAbs();
    groups.of_plane[i] = numbers.find_or_add(group_key(planes[i], normal, size_m));
    groups.count = std::max<std::size_t>(groups.count, groups.of_plane[i] + 1);
  }
  return groups;
}

}  // namespace

std::vector<float> trust_planes(const std::vector<Eigen::Vector3d>& planes, const PlaneMatches& matches,
                                const TrustInput& input) {
  const Groups groups = group_planes(planes, matches, kPatchSize, true);
  std::vector<Patch> patches(groups.count);
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (matches[i]) patches[groups.of_plane[i]].add(*matches[i]);
  }
  Judgement judgement = judge(patches, input, Vector6d::Zero());
  if (judgement.condemned > kMostCondemned) {
    Judgement agreed = consensus(patches, input);
    if (agreed.condemned < kAgreed * judgement.condemned) judgement = std::move(agreed);
  }
  std::vector<float> factors(planes.size(), 1.0F);
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (matches[i]) factors[i] = judgement.trust[groups.of_plane[i]];
  }
  return factors;
}

void share_errors(const std::vector<Eigen::Vector3d>& planes, const PlaneMatches& matches,
                  double correlation_factor, std::vector<float>* factors) {
  const Groups groups = group_planes(planes, matches, kShareSize, false);
  std::vector<double> shared(groups.count, 0.0);  // variance, in that of what chance leaves of the mean
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (!matches[i]) continue;
    const double weight = static_cast<double>((*factors)[i]) / matches[i]->variance;
    shared[groups.of_plane[i]] += weight * matches[i]->shared_variance / correlation_factor;
  }
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (matches[i]) (*factors)[i] /= static_cast<float>(1.0 + shared[groups.of_plane[i]]);
  }
}

}  // namespace fdi_lio::matching
