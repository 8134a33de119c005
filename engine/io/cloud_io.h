#pragma once
// Bytes in, clouds out, and back. Pure functions over byte spans: files, pipes and sandboxes are the
// caller's.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/cloud.h"
#include "engine/core/result.h"

namespace pointwright {

enum class CloudFormat { kDraco, kPly, kXyz, kObj, kPcd, kLas, kDracoTiles };
inline constexpr CloudFormat kLastCloudFormat = CloudFormat::kDracoTiles;

/// By magic bytes ("DRACO", "ply" + line end, "LASF", a PCD header, those of a ZIP archive that begins with
/// the index of Draco tiles); else text is OBJ where a line starts with "v" and a number, and XYZ where it
/// starts with numbers.
/// Errors: kUnsupportedFormat, kEmptyCloud for no bytes.
Result<CloudFormat> detect_format(std::span<const std::byte> bytes);

std::string_view format_name(CloudFormat format);  ///< "draco", …, "draco-tiles"
/// Whether write_cloud() knows the format: OBJ and PCD are read alone.
bool is_writable(CloudFormat format);

/// Where a file can say a position: at offset + scale * (a whole number), by axis. LAS files have one.
struct PositionGrid {
  Vec3d scale = Vec3d::Ones();
  Vec3d offset = Vec3d::Zero();
  friend bool operator==(const PositionGrid&, const PositionGrid&) = default;
};

/// What to do with what was read.
struct ImportParams {
  /// kTooLarge beyond, from the header, before anything is allocated.
  std::uint64_t max_samples = 50'000'000;
  bool drop_non_finite = false;  ///< drop such samples and count them, instead of kNonFinite
};

/// Least and greatest finite value of a scalar.
struct AttributeRange {
  std::string name;
  std::string type;  ///< "int8", "uint8", … "float32", "float64"
  double min = 0.0;
  double max = 0.0;
  std::uint64_t non_finite = 0;  ///< values that are neither counted in min nor in max
};

/// The origin that read_cloud() gives a cloud between these corners: zero on the axes where float32 serves
/// its positions well as they are.
Vec3d recentring_origin(const Vec3d& min, const Vec3d& max);

enum class NormalQuality { kNone, kUnit, kScaled };

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
  std::vector<std::string> skipped;              ///< elements and list properties that were skipped
  NormalQuality normals = NormalQuality::kNone;  ///< kScaled: the file's were not of unit length
  std::vector<AttributeRange> ranges;            ///< of every scalar
  double spacing = 0.0;  ///< median distance to the nearest other sample, of up to 4096 of them; model units
  Vec3d step =
      Vec3d::Zero();  ///< by axis, the smallest step that the file's positions can make where coarsest
  std::optional<PositionGrid> grid;   ///< of a LAS file
  std::vector<std::string> warnings;  ///< sentences for a person; none: nothing is to be wondered at
  Vec3d bounds_min = Vec3d::Zero();   ///< model space
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
  /// LAS: the grid of the file that the cloud came from. It is kept where it holds every position to the bit,
  /// and halved as often as 32 bits allow where it does not, so that samples that did not move keep theirs.
  std::optional<PositionGrid> grid;
};

/// Writes a cloud with all its attributes. PLY: float64 positions where the cloud's were (or where the origin
/// makes float32 lose bits), original properties, names and types. Draco: sequential, float64 origin in the
/// metadata. Draco tiles: the same in pieces of one archive (draco_tiles.h), always in coherent order. LAS:
/// 1.2 or, where the columns need it, 1.4, on the grid of the params, or on one of decimals where that holds
/// every position, or on the finest one that 32 bits span; the further columns as extra bytes.
/// Errors: kInvalidArgument, kEmptyCloud; kUnsupportedFormat for OBJ, PCD, and XYZ with params it cannot hold
Result<std::vector<std::byte>> write_cloud(const Cloud& cloud, CloudFormat format,
                                           const ExportParams& params);

}  // namespace pointwright
