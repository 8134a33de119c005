#include "engine/editing/shape_checks.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace pointwright {
namespace {

constexpr double kMaxNumber = 1e12;

}  // namespace

Error shape_error(ErrorCode code, const char* message, const char* field) {
  return {.code = code, .message = message, .field = field};
}

Result<void> check_numbers(const double* numbers, std::size_t count, const char* field) {
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(numbers[i]))
      return shape_error(ErrorCode::kNonFinite, "the numbers must be finite", field);
    if (std::abs(numbers[i]) > kMaxNumber) {
      Error error = shape_error(ErrorCode::kOutOfRange, "the numbers must lie within 1e12 of zero", field);
      error.limit = kMaxNumber;
      error.actual = std::abs(numbers[i]);
      return error;
    }
  }
  return {};
}

Result<void> check_lengths(const double* lengths, std::size_t count, const char* field) {
  if (auto numbers = check_numbers(lengths, count, field); !numbers) return numbers;
  const double least = *std::min_element(lengths, lengths + count);
  if (least > 0.0) return {};
  Error error = shape_error(ErrorCode::kInvalidArgument, "must be greater than 0", field);
  error.limit = 0.0;
  error.actual = least;
  return error;
}

// Rows and columns are scaled first: distances to the eye and depths differ by many orders of magnitude.
bool is_singular(const ShapeMatrix& numbers) {
  Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
  for (int side = 0; side < 2; ++side) {
    for (Eigen::Index row = 0; row < 4; ++row) {
      const double largest = matrix.row(row).cwiseAbs().maxCoeff();
      if (largest <= 0.0) return true;
      matrix.row(row) /= largest;
    }
    matrix.transposeInPlace();
  }
  return !matrix.fullPivLu().isInvertible();
}

}  // namespace pointwright
