#include "fdi_lio/features/feature_extractor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/wide_vectors.hpp"

namespace fdi_lio::features {

namespace {

/// What the points of one ring are good for.
struct RingScratch {
  std::vector<float> range;
  std::vector<double> way;  ///< from the lidar along the means of the usable points' windows to each [m]
  std::vector<float> curvature;
  std::vector<float> texture;  ///< intensity gradient over that of the scan, [0, 1]; empty without intensity
  std::vector<float> score;    ///< composite
  std::vector<char> usable;
};

/// Features of one ring, as indices into the scan.
struct RingFeatures {
  std::vector<std::uint32_t> planes;
  std::vector<float> plane_scores;
  std::vector<std::uint32_t> edges;
  std::vector<float> edge_scores;
  std::vector<std::uint32_t> textures;
  std::vector<float> texture_scores;
};

/// What holds for all rings of a scan.
struct ScanContext {
  const DeskewedScan* scan;
  float range_noise_m;
  float texture_weight;                                  ///< w of the composite score
  float largest_texture;                                 ///< intensity gradient that counts as 1
  std::uint32_t plane_quota, edge_quota, texture_quota;  ///< of one sector
};

/// View of one ring of a scan.
struct Ring {
  const Point* points;
  std::uint32_t size;
  std::uint32_t offset;
};

/// Half width of each point's window in points: wide enough in metres that range noise does not hide the
/// shape.
FDI_LIO_WIDE_VECTORS std::vector<std::uint32_t> window_sizes(const Ring& ring, const FeatureConfig& config,
                                                             const std::vector<float>& range) {
  const auto least = static_cast<std::uint32_t>(config.curvature_neighbours);
  const auto most = 4 * least;
  const float angle_step = 2.0F * static_cast<float>(M_PI) / static_cast<float>(std::max(ring.size, 360U));
  const auto half_width = static_cast<float>(config.curvature_half_width_m);
  std::vector<std::uint32_t> sizes(ring.size);
  for (std::uint32_t i = 0; i < ring.size; ++i) {
    const float wanted = std::ceil(half_width / (range[i] * angle_step));
    sizes[i] = std::clamp(static_cast<std::uint32_t>(std::min(wanted, 1000.0F)), least, most);
  }
  return sizes;
}

/// Deviation of point i from the middle of its N = 2 n neighbours, as in Zhang and Singh, "LOAM", RSS 2014,
/// eq. (1), but set against the spread of the neighbours instead of the range, and less what range noise
/// alone produces:
///   c_i = max(0, |sum_j (p_j - p_i)| - 2 sigma sqrt(N^2 + N)) / ((n + 1) / 2 (|p_{i+n} - p_i| + |p_{i-n} -
///   p_i|)).
/// So 0 is a straight line, 0.71 a right angle and 1 a spike, whatever the beam spacing and the range. The
/// means of the same windows are those that `way` leads along.
FDI_LIO_WIDE_VECTORS void compute_curvature(const Ring& ring, const FeatureConfig& config,
                                            float range_noise_m, RingScratch* scratch) {
  scratch->range.resize(ring.size);
  scratch->way.assign(ring.size, 0.0);
  scratch->curvature.assign(ring.size, 0.0F);
  scratch->usable.assign(ring.size, 0);
  for (std::uint32_t i = 0; i < ring.size; ++i) scratch->range[i] = ring.points[i].position.norm();
  const std::vector<std::uint32_t> sizes = window_sizes(ring, config, scratch->range);
  std::vector<Eigen::Vector3d> prefix(ring.size + 1, Eigen::Vector3d::Zero());
  for (std::uint32_t i = 0; i < ring.size; ++i)
    prefix[i + 1] = prefix[i] + ring.points[i].position.cast<double>();
  Eigen::Vector3f mean_before = Eigen::Vector3f::Zero();
  double way = 0.0;
  for (std::uint32_t i = 0; i < ring.size; ++i) {
    const std::uint32_t n = sizes[i];
    if (i < n || i + n >= ring.size) continue;
    const Eigen::Vector3f& p = ring.points[i].position;
    const auto count = static_cast<float>(2 * n);
    const Eigen::Vector3f window = (prefix[i + n + 1] - prefix[i - n]).cast<float>();
    const Eigen::Vector3f mean = window / (count + 1.0F);
    way += (mean - mean_before).norm();
    mean_before = mean;
    scratch->way[i] = way;
    const float deviation = (window - (count + 1.0F) * p).norm();
    const float spread =
        0.5F * static_cast<float>(n + 1) *
        ((ring.points[i + n].position - p).norm() + (ring.points[i - n].position - p).norm());
    const float noise_floor = 2.0F * range_noise_m * std::sqrt(count * count + count);
    scratch->usable[i] = 1;
    if (spread > 0.0F)
      scratch->curvature[i] = std::min(1.0F, std::max(0.0F, deviation - noise_floor) / spread);
  }
}

/// Excludes the far side of range jumps (its border moves with the sensor), both sides of missing returns,
/// and surfaces that the beam grazes (LOAM, section V-A).
void exclude_unreliable(const Ring& ring, const FeatureConfig& config, RingScratch* scratch) {
  const auto n = static_cast<std::uint32_t>(config.curvature_neighbours);
  if (ring.size < 2 * n + 1) return;
  const auto jump_ratio = static_cast<float>(config.occlusion_jump_ratio);
  const float min_sine = std::sin(static_cast<float>(config.min_incidence_deg * M_PI / 180.0));
  for (std::uint32_t i = 0; i + 1 < ring.size; ++i) {
    const float near_range = std::min(scratch->range[i], scratch->range[i + 1]);
    const float jump = scratch->range[i + 1] - scratch->range[i];
    if (std::abs(jump) <= jump_ratio * near_range) continue;
    if (jump > 0.0F) {
      const std::uint32_t last = std::min(ring.size - 1, i + n);
      for (std::uint32_t j = i + 1; j <= last; ++j) scratch->usable[j] = 0;
    } else {
      const std::uint32_t first = i + 1 > n ? i + 1 - n : 0;
      for (std::uint32_t j = first; j <= i; ++j) scratch->usable[j] = 0;
    }
  }
  for (std::uint32_t i = n; i + n < ring.size; ++i) {
    if (scratch->usable[i] == 0) continue;
    const Eigen::Vector3f tangent = ring.points[i + 1].position - ring.points[i - 1].position;
    const float sine_sq_scaled = ring.points[i].position.cross(tangent).squaredNorm();
    const float scale = scratch->range[i] * scratch->range[i] * tangent.squaredNorm();
    if (sine_sq_scaled < min_sine * min_sine * scale) scratch->usable[i] = 0;
  }
}

/// Composite score S = (1 - w) C + w IDG / IDG_max + eta stab of each point.
void compute_score(const Ring& ring, const FeatureConfig& config, const ScanContext& context,
                   RingScratch* scratch) {
  scratch->score = scratch->curvature;
  scratch->texture.clear();
  const DeskewedScan& scan = *context.scan;
  if (scan.intensity_gradient.empty()) return;
  scratch->texture.resize(ring.size);
  const auto eta = static_cast<float>(config.score_stability);
  const float w = context.texture_weight;
  for (std::uint32_t i = 0; i < ring.size; ++i) {
    const float gradient = scan.intensity_gradient[ring.offset + i];
    scratch->texture[i] = std::min(1.0F, gradient / context.largest_texture);
    const float stability = scan.gradient_stability.empty() ? 0.0F : scan.gradient_stability[ring.offset + i];
    scratch->score[i] = (1.0F - w) * scratch->curvature[i] + w * scratch->texture[i] + eta * stability;
  }
}

/// Smooth points with a high intensity gradient, the best by score.
void select_textures(const Ring& ring, const RingScratch& scratch, const FeatureConfig& config,
                     const ScanContext& context, std::uint32_t begin, std::uint32_t end, RingFeatures* out) {
  if (scratch.texture.empty() || context.texture_quota == 0) return;
  const auto smooth = static_cast<float>(config.plane_max_curvature);
  const float least = static_cast<float>(config.intensity_min_gradient) / context.largest_texture;
  std::vector<std::uint32_t> candidates;
  for (std::uint32_t i = begin; i < end; ++i) {
    if (scratch.usable[i] != 0 && scratch.curvature[i] <= smooth && scratch.texture[i] > least)
      candidates.push_back(i);
  }
  if (candidates.size() > context.texture_quota) {
    // Of equal scores the first ones.
    const auto is_better = [&scratch](std::uint32_t a, std::uint32_t b) {
      return scratch.score[a] != scratch.score[b] ? scratch.score[a] > scratch.score[b] : a < b;
    };
    std::nth_element(candidates.begin(), candidates.begin() + context.texture_quota, candidates.end(),
                     is_better);
    candidates.resize(context.texture_quota);
    std::sort(candidates.begin(), candidates.end());
  }
  for (const std::uint32_t i : candidates) {
    out->textures.push_back(ring.offset + i);
    out->texture_scores.push_back(scratch.score[i]);
  }
}

void select_edges(const Ring& ring, const RingScratch& scratch, const FeatureConfig& config,
                  std::uint32_t quota, std::uint32_t begin, std::uint32_t end, RingFeatures* out) {
  const auto n = static_cast<std::uint32_t>(config.curvature_neighbours);
  const auto threshold = static_cast<float>(config.edge_min_curvature);
  std::vector<std::uint32_t> candidates;
  for (std::uint32_t i = begin; i < end; ++i) {
    if (scratch.usable[i] != 0 && scratch.curvature[i] > threshold) candidates.push_back(i);
  }
  std::stable_sort(candidates.begin(), candidates.end(), [&scratch](std::uint32_t a, std::uint32_t b) {
    return scratch.score[a] > scratch.score[b];
  });
  std::vector<std::uint32_t> taken;
  for (const std::uint32_t candidate : candidates) {
    if (taken.size() >= quota) break;
    const bool is_near_taken = std::any_of(taken.begin(), taken.end(), [&](std::uint32_t other) {
      return (candidate > other ? candidate - other : other - candidate) <= n;
    });
    if (is_near_taken) continue;
    taken.push_back(candidate);
    out->edges.push_back(ring.offset + candidate);
    out->edge_scores.push_back(scratch.score[candidate]);
  }
}

/// Of each stretch of the ring, `plane_spacing` long, the flat point nearest to its middle. The choice must
/// be blind to noise and to the sense in which the rotor turns. The first point far enough from the last
/// would be one that its own noise took there (so the way is that of the windows' means); and behind each gap
/// in a wall it would always be the first one, never the last one before it. Either turns each scan against
/// the rotor.
void select_planes(const Ring& ring, const RingScratch& scratch, const FeatureConfig& config,
                   std::uint32_t quota, std::uint32_t begin, std::uint32_t end, RingFeatures* out) {
  const auto threshold = static_cast<float>(config.plane_max_curvature);
  std::vector<std::uint32_t> taken;
  double stretch = -1.0;  // none yet
  double least_off = 0.0;
  for (std::uint32_t i = begin; i < end; ++i) {
    if (scratch.usable[i] == 0 || scratch.curvature[i] > threshold) continue;
    const double at = scratch.way[i] / config.plane_spacing_m;
    const double off = std::abs(at - std::floor(at) - 0.5);
    const bool is_new_stretch = std::floor(at) != stretch;
    if (!is_new_stretch && off >= least_off) continue;
    if (is_new_stretch) {
      taken.push_back(i);
    } else {
      taken.back() = i;
    }
    stretch = std::floor(at);
    least_off = off;
  }
  // Over the quota every k-th stays, so that what is left still covers the sector evenly.
  const std::size_t count = std::min<std::size_t>(quota, taken.size());
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t i = taken[(2 * k + 1) * taken.size() / (2 * count)];
    out->planes.push_back(ring.offset + i);
    out->plane_scores.push_back(1.0F - scratch.curvature[i] / threshold);
  }
}

RingFeatures extract_ring(const Ring& ring, const FeatureConfig& config, const ScanContext& context) {
  RingScratch scratch;
  compute_curvature(ring, config, context.range_noise_m, &scratch);
  exclude_unreliable(ring, config, &scratch);
  compute_score(ring, config, context, &scratch);
  RingFeatures out;
  const auto sectors = static_cast<std::uint32_t>(config.sectors);
  for (std::uint32_t sector = 0; sector < sectors; ++sector) {
    const std::uint32_t begin = ring.size * sector / sectors;
    const std::uint32_t end = ring.size * (sector + 1) / sectors;
    select_edges(ring, scratch, config, context.edge_quota, begin, end, &out);
    select_planes(ring, scratch, config, context.plane_quota, begin, end, &out);
    select_textures(ring, scratch, config, context, begin, end, &out);
  }
  return out;
}

/// Drops the intensity features with the lowest scores, so that at most `limit` stay.
void keep_best_textures(std::size_t limit, std::vector<RingFeatures>* rings) {
  std::vector<float> scores;
  for (const RingFeatures& ring : *rings)
    scores.insert(scores.end(), ring.texture_scores.begin(), ring.texture_scores.end());
  if (scores.size() <= limit) return;
  const auto worst = scores.end() - static_cast<std::ptrdiff_t>(limit);
  std::nth_element(scores.begin(), worst, scores.end());
  const float least = limit > 0 ? *worst : std::numeric_limits<float>::max();
  for (RingFeatures& ring : *rings) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < ring.textures.size(); ++k) {
      if (ring.texture_scores[k] < least) continue;
      ring.textures[kept] = ring.textures[k];
      ring.texture_scores[kept++] = ring.texture_scores[k];
    }
    ring.textures.resize(kept);
    ring.texture_scores.resize(kept);
  }
}

/// w = w0 + alpha FDI + beta delta, clamped to [0, w_max]; delta is +1 in sparse, -1 in structured
/// surroundings, else 0.
float texture_weight(const FeatureConfig& config, const degeneracy::Degeneracy& previous) {
  double delta = 0.0;
  if (previous.environment == degeneracy::EnvironmentClass::kSparse) delta = 1.0;
  if (previous.environment == degeneracy::EnvironmentClass::kStructured) delta = -1.0;
  const double w =
      config.score_weight + config.score_fdi_gain * previous.fdi + config.score_class_gain * delta;
  return static_cast<float>(std::clamp(w, 0.0, config.score_max_weight));
}

/// Thresholds of the scan, from the feedback of the one before:
///   edge  = t_edge (1 - a FDI) (1 + b c),   plane = t_plane (1 + a FDI) (1 - b c),   c = C / (1 + C)
/// with the curvature complexity C. Degraded surroundings admit more of both; where the curvature is uneven
/// only what is clearly sharp or clearly flat counts.
FeatureConfig with_thresholds(FeatureConfig config, const degeneracy::Degeneracy& previous) {
  const double complexity = previous.metrics.curvature_complexity;
  const double degraded = config.threshold_fdi_gain * previous.fdi;
  const double uneven = config.threshold_complexity_gain * complexity / (1.0 + complexity);
  config.edge_min_curvature *= (1.0 - degraded) * (1.0 + uneven);
  config.plane_max_curvature *= (1.0 + degraded) * (1.0 - uneven);
  return config;
}

/// Robust maximum of the scan's intensity gradient, the 99 % quantile; never so small that noise counts.
float largest_texture(const DeskewedScan& scan, float least) {
  constexpr std::size_t kStride = 8;
  constexpr double kQuantile = 0.99;
  std::vector<float> sample;
  sample.reserve(scan.intensity_gradient.size() / kStride + 1);
  for (std::size_t i = 0; i < scan.intensity_gradient.size(); i += kStride)
    sample.push_back(scan.intensity_gradient[i]);
  if (sample.empty()) return least;
  const auto at =
      sample.begin() + static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(sample.size() - 1));
  std::nth_element(sample.begin(), at, sample.end());
  return std::max(least, *at);
}

}  // namespace

FeatureExtractor::FeatureExtractor(const Config& config, Reporter* reporter)
    : config_(config.features),
      range_noise_m_(static_cast<float>(config.sensor.range_noise_m)),
      reporter_(reporter) {}

FeatureSet FeatureExtractor::extract(const DeskewedScan& scan, const degeneracy::Degeneracy& previous) {
  const std::size_t rings = scan.ring_count();
  FeatureSet features;
  features.stamp = scan.stamp;
  if (rings == 0) return features;
  const std::size_t cells = rings * static_cast<std::size_t>(config_.sectors);
  const auto quota = [cells](int total) {
    return static_cast<std::uint32_t>((static_cast<std::size_t>(total) + cells - 1) / cells);
  };
  const FeatureConfig thresholds = with_thresholds(config_, previous);
  ScanContext context{};
  context.scan = &scan;
  context.range_noise_m = range_noise_m_;
  context.texture_weight = texture_weight(config_, previous);
  context.largest_texture =
      largest_texture(scan, std::max(1e-3F, static_cast<float>(config_.intensity_min_gradient)));
  context.plane_quota = quota(config_.max_planes);
  context.edge_quota = quota(config_.max_edges);
  // Texture comes in patches: a sector may hold several times its share, and the best of the scan stay.
  context.texture_quota = 4 * quota(config_.max_intensity);
  std::vector<RingFeatures> found(rings);
  parallel_chunks(rings, 4, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t r = begin; r < end; ++r) {
      const Ring ring{scan.points.data() + scan.ring_begin[r], scan.ring_begin[r + 1] - scan.ring_begin[r],
                      scan.ring_begin[r]};
      found[r] = extract_ring(ring, thresholds, context);
    }
  });
  keep_best_textures(static_cast<std::size_t>(config_.max_intensity), &found);
  for (const RingFeatures& ring : found) {
    for (const std::uint32_t i : ring.planes) features.planes.push_back(scan.points[i]);
    for (const std::uint32_t i : ring.edges) features.edges.push_back(scan.points[i]);
    for (const std::uint32_t i : ring.textures) {
      features.intensity_edges.push_back(scan.points[i]);
      features.intensity_edges.back().intensity = scan.intensity_level[i];
    }
    const auto append = [](const std::vector<float>& from, std::vector<float>* to) {
      to->insert(to->end(), from.begin(), from.end());
    };
    append(ring.plane_scores, &features.plane_scores);
    append(ring.edge_scores, &features.edge_scores);
    append(ring.texture_scores, &features.intensity_scores);
  }
  if (features.planes.empty() && features.edges.empty()) {
    reporter_->report(
        Severity::kWarning, "features_none",
        "a scan of " + std::to_string(scan.points.size()) + " points has no edge and no plane feature");
  }
  return features;
}

}  // namespace fdi_lio::features
