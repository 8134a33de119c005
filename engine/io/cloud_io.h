#pragma once
// Bytes in, clouds out, and back. Pure functions over byte spans: files, pipes and sandboxes are the
// caller's.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/result.h"

namespace pointwright {

enum class CloudFormat { kDraco, kPly, kXyz };

/// By magic bytes ("DRACO", "ply" + line end), else text that starts with numbers is XYZ.
/// Errors: kUnsupportedFormat, kEmptyCloud for no bytes.
Result<CloudFormat> detect_format(std::span<const std::byte> bytes);

std::string_view format_name(CloudFormat format);  ///< "draco", "ply", "xyz"

/// What to do with what was read.
struct ImportParams {
  /// kTooLarge beyond, from the header, before anything is allocated.
  std::uint64_t max_samples = 50'000'000;
  bool drop_non_finite = false;  ///< drop such samples and count them, instead of kNonFinite
};

/// What was found: the upload's lint.
struct ImportReport {
  CloudFormat format = CloudFormat::kPly;
  std::string encoding;              ///< "binary_little_endian", "sequential", … as the format calls it
  std::uint64_t declared_count = 0;  ///< what the header claims
  std::uint64_t sample_count = 0;    ///< what the cloud holds
  std::uint64_t dropped_non_finite = 0;
  std::uint64_t duplicate_count = 0;  ///< samples that stand exactly where an earlier one stands; kept
  bool from_mesh = false;             ///< faces were present and left out
  bool position_is_double = false;
  /// "normal", "color", "texcoord", then the further properties by name.
  std::vector<std::string> attributes;
  std::vector<std::string> skipped;  ///< elements and list properties that were skipped
  Vec3d bounds_min = Vec3d::Zero();  ///< model space
  Vec3d bounds_max = Vec3d::Zero();
};

struct ImportedCloud {
  Cloud cloud;  ///< in coherent order, recentred where that keeps precision
  ImportReport report;
};

/// Reads a cloud and puts it in order: finite check, range check (|x| <= 1e9; extent at least 1e-5 of the
/// offset), recentring, coherent order, duplicate count. Draco: the bytes are decoded in this process; the
/// gate of io/draco_gate.h runs first. The daemon calls this inside its confined decoder only.
/// Errors: kEmptyCloud, kMalformedData (with line or byte offset), kUnsupportedFormat, kNonFinite,
///         kOutOfRange, kTooLarge
/// Cost:   O(bytes + N log N)
Result<ImportedCloud> read_cloud(std::span<const std::byte> bytes, CloudFormat format,
                                 const ImportParams& params);

struct ExportParams {
  bool caller_order = true;     ///< restore the caller's sample order
  bool ascii = false;           ///< PLY: text instead of binary little-endian
  int draco_position_bits = 0;  ///< 0: lossless float32; else 8 to 30
};

/// Writes a cloud with all its attributes. PLY: float64 positions where the cloud's were (or where the origin
/// makes float32 lose bits), original properties, names and types. Draco: sequential, float64 origin in the
/// metadata.
/// Errors: kInvalidArgument, kEmptyCloud; kUnsupportedFormat for XYZ with params it cannot hold
Result<std::vector<std::byte>> write_cloud(const Cloud& cloud, CloudFormat format,
                                           const ExportParams& params);

}  // namespace pointwright
