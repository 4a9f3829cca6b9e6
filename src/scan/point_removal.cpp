#include "fdi_lio/scan/point_removal.hpp"

namespace fdi_lio::scan {

void remove_points(const std::vector<RemovalReason>& reasons, DeskewedScan* scan) {
  if (reasons.empty()) return;
  std::uint32_t kept = 0;
  std::uint32_t i = 0;
  for (std::size_t ring = 0; ring < scan->ring_count(); ++ring) {
    const std::uint32_t end = scan->ring_begin[ring + 1];
    scan->ring_begin[ring] = kept;
    for (; i < end; ++i) {
      if (reasons[i] != RemovalReason::kNone) {
        scan->removed.push_back(scan->points[i]);
        scan->removal_reasons.push_back(reasons[i]);
        continue;
      }
      scan->points[kept] = scan->points[i];
      for (std::vector<float>* values :
           {&scan->intensity_level, &scan->intensity_gradient, &scan->gradient_stability}) {
        if (!values->empty()) (*values)[kept] = (*values)[i];
      }
      ++kept;
    }
  }
  if (!scan->ring_begin.empty()) scan->ring_begin.back() = kept;
  scan->points.resize(kept);
  for (std::vector<float>* values :
       {&scan->intensity_level, &scan->intensity_gradient, &scan->gradient_stability}) {
    if (!values->empty()) values->resize(kept);
  }
}

}  // namespace fdi_lio::scan
