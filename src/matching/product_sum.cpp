#include "fdi_lio/matching/product_sum.hpp"

#include <cstring>

namespace fdi_lio::matching {

namespace {

using WideDoubles = double __attribute__((vector_size(kWideAlignment)));

/// Adds w J [J' r 0] of `count` rows [J' r 0] to six rows of sums.
FDI_LIO_WIDE_VECTORS void add_products(const double* rows, const double* weights, std::size_t count,
                                       double* sums) {
  constexpr std::size_t kHalf = kWideAlignment / sizeof(double);
  WideDoubles left[6];
  WideDoubles right[6];
  for (std::size_t k = 0; k < 6; ++k) {
    std::memcpy(&left[k], sums + 2 * kHalf * k, sizeof(WideDoubles));
    std::memcpy(&right[k], sums + 2 * kHalf * k + kHalf, sizeof(WideDoubles));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const double* row = rows + 2 * kHalf * i;
    WideDoubles row_left;
    WideDoubles row_right;
    std::memcpy(&row_left, row, sizeof(row_left));
    std::memcpy(&row_right, row + kHalf, sizeof(row_right));
    for (std::size_t k = 0; k < 6; ++k) {
      const double factor = weights[i] * row[k];
      left[k] += factor * row_left;
      right[k] += factor * row_right;
    }
  }
  for (std::size_t k = 0; k < 6; ++k) {
    std::memcpy(sums + 2 * kHalf * k, &left[k], sizeof(WideDoubles));
    std::memcpy(sums + 2 * kHalf * k + kHalf, &right[k], sizeof(WideDoubles));
  }
}

}  // namespace

void ProductSum::sum_up() {
  add_products(rows_.data(), weights_.data(), waiting_, sums_.data());
  waiting_ = 0;
}

void ProductSum::add(const ProductSum& other) {
  sum_up();
  ProductSum summed = other;
  summed.sum_up();
  for (std::size_t k = 0; k < sums_.size(); ++k) sums_[k] += summed.sums_[k];
}

Matrix6d ProductSum::H() const {
  ProductSum summed = *this;
  summed.sum_up();
  Matrix6d H;
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column) H(row, column) = summed.sums_[kColumns * row + column];
  return H;
}

Vector6d ProductSum::b() const {
  ProductSum summed = *this;
  summed.sum_up();
  Vector6d b;
  for (int row = 0; row < 6; ++row) b[row] = summed.sums_[kColumns * row + 6];
  return b;
}

}  // namespace fdi_lio::matching
