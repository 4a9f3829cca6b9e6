#include "fdi_lio/common/reporter.hpp"

#include <utility>

namespace fdi_lio {

namespace {

bool is_power_of_ten(std::uint64_t value) {
  while (value >= 10 && value % 10 == 0) value /= 10;
  return value == 1;
}

}  // namespace

void Reporter::report(Severity severity, const std::string& key, const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Notice& notice = notices_[key];
  notice.severity = severity;
  notice.text = text;
  ++notice.count;
  if (is_power_of_ten(notice.count)) due_.push_back(notice);
}

std::vector<Notice> Reporter::take_new() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(due_, {});
}

std::map<std::string, Notice> Reporter::notices() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return notices_;
}

bool Reporter::has(const std::string& key) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return notices_.count(key) != 0;
}

}  // namespace fdi_lio
