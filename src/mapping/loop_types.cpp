#include "fdi_lio/mapping/loop_types.hpp"

namespace fdi_lio::mapping {

const char* to_text(LoopVerdict verdict) {
  static constexpr const char* kTexts[] = {
      "accepted",       "low_overlap",         "few_walls",    "high_residual", "intensity_disagrees",
      "no_information", "far_from_prediction", "inconsistent", "unconfirmed",   "pending"};
  return kTexts[static_cast<int>(verdict)];
}

const char* to_text(LoopSource source) { return source == LoopSource::kDistance ? "distance" : "descriptor"; }

}  // namespace fdi_lio::mapping
