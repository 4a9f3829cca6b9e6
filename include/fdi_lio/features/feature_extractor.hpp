#pragma once

#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"

namespace fdi_lio::features {

/// The work of the feature_extraction node: edges and planes by curvature along the rings, intensity features
/// by the intensity gradient on smooth surfaces; the best of each sector by the composite score.
class FeatureExtractor {
 public:
  FeatureExtractor(const Config& config, Reporter* reporter);

  /// `previous` is the degeneracy of the scan before (neutral when none came).
  FeatureSet extract(const DeskewedScan& scan, const degeneracy::Degeneracy& previous);

 private:
  FeatureConfig config_;
  float range_noise_m_;
  Reporter* reporter_;
};

}  // namespace fdi_lio::features
