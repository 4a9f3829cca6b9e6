#include "fdi_lio/scan/intensity_model.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Geometry>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {

constexpr std::size_t kSampleStride = 16;
constexpr std::size_t kChunk = 8192;
/// Intensities are constant when more than this share of them are one value.
constexpr double kConstantShare = 0.98;
constexpr float kLeastCosine = 0.1F;
constexpr float kLargestIntensity = 1e20F;  ///< instead of infinity, so that J stays finite
/// Gains are the mean over the first scans, then follow slowly: only what stays with the beam counts.
constexpr int kGainScans = 50;
constexpr int kGainColumnStride = 4;
/// Neighbouring beams share a surface when their ranges differ by less; texture differs by more than a gain.
constexpr float kSharedRange = 0.15F;
constexpr float kLargestGainStep = 0.4F;
/// The range profile forgets slowly, and is drawn to none where it has seen little.
constexpr double kProfileMemory = 0.98;
constexpr double kProfilePrior = 0.5;
constexpr float kProfileStep_m = 0.25F;
constexpr std::size_t kProfileSteps = 1024;

/// Cosine of the angle between the beam and the surface's normal, as far as the ring shows it.
float incidence_cosine(const DeskewedScan& scan, std::size_t i) {
  const std::size_t last = scan.points.size() - 1;
  const Point& a = scan.points[i > 0 ? i - 1 : i];
  const Point& b = scan.points[i < last ? i + 1 : i];
  const Eigen::Vector3f& p = scan.points[i].position;
  const Eigen::Vector3f tangent = b.position - a.position;
  const float scale = p.norm() * tangent.norm();
  if (a.ring != b.ring || scale <= 0.0F) return 1.0F;
  return std::max(kLeastCosine, p.cross(tangent).norm() / scale);
}

}  // namespace

bool IntensityModel::is_usable(const DeskewedScan& scan, float* median) {
  if (!config_.enabled || !scan.has_intensity || scan.points.empty()) return false;
  std::vector<float> sample;
  std::size_t positive = 0;
  for (std::size_t i = 0; i < scan.points.size(); i += kSampleStride) {
    const float intensity = scan.points[i].intensity;
    if (!std::isfinite(intensity)) continue;
    sample.push_back(intensity);
    if (intensity > 0.0F) ++positive;
  }
  const std::size_t looked_at = (scan.points.size() + kSampleStride - 1) / kSampleStride;
  if (sample.size() < looked_at / 2 || positive == 0) {
    reporter_->report(Severity::kWarning, "intensity_absent",
                      "the intensities of a scan are zero or not finite: geometry alone is used");
    return false;
  }
  const auto ranked = [&sample](std::size_t rank) {
    std::nth_element(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(rank), sample.end());
    return sample[rank];
  };
  *median = ranked(sample.size() / 2);
  const auto equal = std::count(sample.begin(), sample.end(), *median);
  if (static_cast<double>(equal) > kConstantShare * static_cast<double>(sample.size())) {
    reporter_->report(Severity::kWarning, "intensity_constant",
                      "nearly all intensities of a scan are " + std::to_string(*median) +
                          " (constant or saturated): geometry alone is used");
    return false;
  }
  // Where most returns are zero the median of the others still tells the scale.
  if (*median <= 0.0F) *median = ranked(sample.size() - positive / 2 - 1);
  return true;
}

void IntensityModel::follow_scale(float median) {
  if (scale_ <= 0.0F) {
    scale_ = median;
    return;
  }
  const auto factor = static_cast<float>(config_.rescale_factor);
  const bool differs = median > factor * scale_ || factor * median < scale_;
  differing_scans_ = differs ? differing_scans_ + 1 : 0;
  if (differing_scans_ < config_.rescale_scans) return;
  reporter_->report(Severity::kWarning, "intensity_scale",
                    "the scale of the intensities changed from " + std::to_string(scale_) + " to " +
                        std::to_string(median) + " (median): the new one is used from now on");
  scale_ = median;
  differing_scans_ = 0;
}

float IntensityModel::range_profile(float range_m) const {
  if (profile_.empty()) return 0.0F;
  return profile_[std::min(static_cast<std::size_t>(range_m / kProfileStep_m), profile_.size() - 1)];
}

std::size_t IntensityModel::range_bin(double range_m) {
  int exponent = 0;  // of the square: half octaves
  std::frexp(range_m * range_m, &exponent);
  return static_cast<std::size_t>(std::clamp(exponent - 1, 0, static_cast<int>(kRangeBins) - 1));
}

void IntensityModel::learn_range_profile(const RangeImage& image, const std::vector<float>& levels) {
  for (double& sum : cross_) sum *= kProfileMemory;
  for (double& sum : square_) sum *= kProfileMemory;
  const auto learn = [&](std::uint32_t i, float range, int ring, int column) {
    if (ring >= image.rings()) return;
    const std::uint32_t j = image.at(ring, column);
    if (j == RangeImage::kNone) return;
    const float other = image.range_at(ring, column);
    if (std::abs(other - range) > kSharedRange * range) return;
    const double step = (other - range) / (0.5 * (other + range));  // d ln(r)
    const double change = std::clamp(levels[j] - levels[i], -kLargestGainStep, kLargestGainStep);
    const std::size_t bin = range_bin(range);
    cross_[bin] += change * step;
    square_[bin] += step * step;
  };
  for (int ring = 0; ring < image.rings(); ++ring) {
    for (int column = ring % kGainColumnStride; column < image.columns(); column += 2 * kGainColumnStride) {
      const std::uint32_t i = image.at(ring, column);
      if (i == RangeImage::kNone) continue;
      const float range = image.range_at(ring, column);
      learn(i, range, ring + 1, column);
      learn(i, range, ring, column + kGainColumnStride);
    }
  }
  profile_.assign(kProfileSteps, 0.0F);
  double value = 0.0;
  for (std::size_t k = 1; k < kProfileSteps; ++k) {
    const double range = kProfileStep_m * (static_cast<double>(k) + 0.5);
    const std::size_t bin = range_bin(range);
    value += cross_[bin] / (square_[bin] + kProfilePrior) * kProfileStep_m / range;
    profile_[k] = static_cast<float>(value);
  }
  const float reference = range_profile(static_cast<float>(config_.reference_range_m));
  for (float& each : profile_) each -= reference;
}

void IntensityModel::learn_gains(const RangeImage& image, const std::vector<float>& levels) {
  gain_scans_ = std::min(gain_scans_ + 1, kGainScans);
  std::vector<float> steps(gains_.size(), 0.0F);
  parallel_chunks(gains_.size(), 8, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t r = begin; r < end; ++r) {
      const int ring = static_cast<int>(r);
      double sum = 0.0;
      int count = 0;
      for (int column = 0; column < image.columns(); column += kGainColumnStride) {
        const std::uint32_t middle = image.at(ring, column);
        if (middle == RangeImage::kNone) continue;
        const float range = image.range_at(ring, column);
        for (const int other_ring : {ring - 1, ring + 1}) {
          if (other_ring < 0 || other_ring >= image.rings()) continue;
          const std::uint32_t other = image.at(other_ring, column);
          if (other == RangeImage::kNone) continue;
          if (std::abs(image.range_at(other_ring, column) - range) > kSharedRange * range) continue;
          sum += std::clamp(levels[middle] - levels[other], -kLargestGainStep, kLargestGainStep);
          ++count;
        }
      }
      if (count > 0) steps[r] = static_cast<float>(sum / count);
    }
  });
  const float rate = 1.0F / static_cast<float>(gain_scans_);
  for (std::size_t r = 0; r < gains_.size(); ++r) gains_[r] += rate * steps[r];
}

std::vector<float> IntensityModel::apply(const DeskewedScan& scan, const RangeImage& image) {
  float median = 0.0F;
  if (!is_usable(scan, &median)) return {};
  follow_scale(median);
  gains_.resize(scan.ring_count(), 0.0F);
  std::vector<float> levels(scan.points.size());
  const auto range_exponent = static_cast<float>(config_.range_exponent);
  const auto incidence_exponent = static_cast<float>(config_.incidence_exponent);
  const auto reference = static_cast<float>(config_.reference_range_m);
  parallel_chunks(levels.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      float intensity = std::min(std::max(0.0F, scan.points[i].intensity), kLargestIntensity);
      if (range_exponent > 0.0F)
        intensity *= std::pow(scan.points[i].position.norm() / reference, range_exponent);
      if (incidence_exponent > 0.0F) intensity /= std::pow(incidence_cosine(scan, i), incidence_exponent);
      levels[i] = 1.0F + intensity / scale_;
    }
    Eigen::Map<Eigen::ArrayXf> chunk(levels.data() + begin, static_cast<Eigen::Index>(end - begin));
    chunk = chunk.log();  // several at a time
    for (std::size_t i = begin; i < end; ++i) levels[i] -= gains_[scan.points[i].ring];
  });
  if (config_.range_profile) {
    learn_range_profile(image, levels);
    parallel_chunks(levels.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) levels[i] -= range_profile(scan.points[i].position.norm());
    });
  }
  if (config_.beam_gains) learn_gains(image, levels);
  return levels;
}

}  // namespace fdi_lio::scan
