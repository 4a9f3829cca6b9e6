#pragma once

#include <optional>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio {

/// What another stage said of earlier scans, for the stage that works on the next one. T has a `stamp`.
/// Late: older than what is known already, changes nothing. Repeated: changes nothing. Missing: the newest
/// that is not too old takes its place, and after that none does.
template <typename T>
class Feedback {
 public:
  explicit Feedback(double max_age_s) : max_age_s_(max_age_s) {}

  void add(const T& value) {
    if (!newest_ || value.stamp > newest_->stamp) newest_ = value;
  }

  /// The newest of an earlier scan than `stamp`, at most `max_age_s` before it.
  std::optional<T> before(Stamp stamp) const {
    if (!newest_ || newest_->stamp >= stamp || seconds_between(newest_->stamp, stamp) > max_age_s_)
      return std::nullopt;
    return newest_;
  }

  /// Stamps start anew.
  void reset() { newest_.reset(); }

 private:
  double max_age_s_;
  std::optional<T> newest_;
};

}  // namespace fdi_lio
