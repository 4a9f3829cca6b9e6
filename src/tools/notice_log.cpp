#include "notice_log.hpp"

#include <iostream>

namespace fdi_lio::tools {

const char* name_of(Severity severity) {
  static constexpr const char* kNames[] = {"info", "warning", "error"};
  return kNames[static_cast<int>(severity)];
}

void print_new(Reporter* reporter) {
  for (const Notice& notice : reporter->take_new()) {
    std::cerr << name_of(notice.severity) << ": " << notice.text;
    if (notice.count > 1) std::cerr << " (" << notice.count << " times so far)";
    std::cerr << "\n";
  }
}

}  // namespace fdi_lio::tools
