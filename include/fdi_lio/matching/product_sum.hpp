#pragma once

#include <array>
#include <cstddef>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/wide_vectors.hpp"

namespace fdi_lio::matching {

/// Normal equations of weighted residuals: the sums of w J J' and w r J. Some residuals wait and are then
/// summed together, with the sums in registers. The order, and so the result, is that in which they were
/// added.
class ProductSum {
 public:
  /// A residual r with the Jacobian J and the weight w.
  void add(double weight, const Vector6d& J, double r) {
    double* row = rows_.data() + kColumns * waiting_;
    for (int k = 0; k < 6; ++k) row[k] = J[k];
    row[6] = r;
    weights_[waiting_] = weight;
    if (++waiting_ == kMostWaiting) sum_up();
  }

  /// Adds all residuals of another one after those of this one.
  void add(const ProductSum& other);

  /// Sum of w J J'.
  Matrix6d H() const;

  /// Sum of w r J.
  Vector6d b() const;

 private:
  static constexpr std::size_t kColumns = 8;  ///< J, r and a zero
  static constexpr std::size_t kMostWaiting = 16;

  void sum_up();

  alignas(kWideAlignment) std::array<double, kColumns * kMostWaiting> rows_{};
  alignas(kWideAlignment) std::array<double, 6 * kColumns> sums_{};  ///< of w J [J' r 0], row by row
  std::array<double, kMostWaiting> weights_{};
  std::size_t waiting_ = 0;
};

}  // namespace fdi_lio::matching
