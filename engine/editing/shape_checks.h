#pragma once
// What the validation of shapes shares: numbers in range, lengths, matrices.

#include <array>
#include <cstddef>

#include "engine/core/result.h"

namespace pointwright {

/// Directions with no component as large as this are "zero".
inline constexpr double kMinDirectionLength = 1e-100;

/// A matrix of a shape, row after row.
using ShapeMatrix = std::array<double, 16>;

Error shape_error(ErrorCode code, const char* message, const char* field);

/// Errors: kNonFinite, kOutOfRange beyond 1e12
Result<void> check_numbers(const double* numbers, std::size_t count, const char* field);

/// Errors: those of check_numbers(); kInvalidArgument unless all are greater than 0
Result<void> check_lengths(const double* lengths, std::size_t count, const char* field);

/// Whether the matrix has no inverse, whatever the units of its rows and columns.
bool is_singular(const ShapeMatrix& matrix);

}  // namespace pointwright
