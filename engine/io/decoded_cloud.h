#pragma once
// read_cloud() in its two halves, for callers that decode in one process and finish in another.

#include <span>

#include "engine/io/cloud_io.h"

namespace pointwright {

/// What the bytes say and nothing more: samples in the file's order with ids 0..N-1, at the file's own origin
/// (0 but for Draco files that carry one), float64 files with their exact positions. Values are not checked:
/// NaN, infinite and far coordinates pass. Starts no thread, opens no file.
/// Errors: kEmptyCloud, kMalformedData (with line or byte offset), kUnsupportedFormat, kTooLarge
Result<ImportedCloud> decode_cloud(std::span<const std::byte> bytes, CloudFormat format,
                                   const ImportParams& params);

/// Puts a decoded cloud in order. Trusts nothing of it but the lengths of its columns.
/// - Non-finite samples are refused with their count and the first of them, or dropped (ids are then counted
///   anew).
/// - Coordinates beyond 1e9, and an extent below 1e-5 (float files; 1e-12 for float64 ones, which hold that
///   much more) of the largest coordinate, are refused; one sample, and samples that all stand on one place,
///   have no extent and pass.
/// - Recentring, by axis: an axis whose coordinates lie within 8 extents of zero keeps origin 0; any other
///   gets as origin the middle of the box, rounded to a power of two of about an eighth of the extent, so
///   that float32 files lose no bit by it. exact_position is kept where origin + position does not give the
///   file's number back.
/// - Coherent order, count of duplicates, bounds.
/// Errors: kEmptyCloud, kNonFinite, kOutOfRange, kTooLarge
/// Cost:   O(N log N)
Result<ImportedCloud> finish_cloud(ImportedCloud decoded, const ImportParams& params);

}  // namespace pointwright
