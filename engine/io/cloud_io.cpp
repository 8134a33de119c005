#include "engine/io/cloud_io.h"

#include <array>
#include <utility>

#include "engine/io/columns.h"
#include "engine/io/decoded_cloud.h"
#include "engine/io/draco_codec.h"
#include "engine/io/draco_tiles.h"
#include "engine/io/las.h"
#include "engine/io/obj.h"
#include "engine/io/pcd.h"
#include "engine/io/ply.h"
#include "engine/io/xyz.h"

namespace pointwright {
namespace {

struct Signature {
  std::string_view start;
  const char* advice;
};

// What people send that is not for us, by its first bytes: they learn what to do instead.
constexpr std::array<Signature, 7> kForeign{{
    {"ASTM-E57",
     "E57 files are not read: convert to LAS or PLY first, with CloudCompare or 'pdal translate' for "
     "example"},
    {"OFF", "OFF files are not read: convert to PLY first"},
    {"\x1f\x8b", "the bytes are gzip-compressed: send them unpacked"},
    {"\x28\xb5\x2f\xfd", "the bytes are zstd-compressed: send them unpacked"},
    {"BZh", "the bytes are bzip2-compressed: send them unpacked"},
    {"PK\x03\x04",
     "the bytes are a zip archive, not one of Draco tiles, whose first file is index.csv: send the file in "
     "it"},
    {"glTF", "glTF files are not read: convert to PLY or Draco first"},
}};

Error unsupported(std::string message) {
  return Error{.code = ErrorCode::kUnsupportedFormat, .message = std::move(message), .field = {}};
}

Error empty_error() {
  return Error{.code = ErrorCode::kEmptyCloud, .message = "there are no bytes", .field = {}};
}

}  // namespace

Result<CloudFormat> detect_format(std::span<const std::byte> bytes) {
  if (bytes.empty()) return empty_error();
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("DRACO")) return CloudFormat::kDraco;
  if (text.starts_with("ply") && text.size() > 3 &&
      std::string_view("\r\n \t").find(text[3]) != std::string_view::npos) {
    return CloudFormat::kPly;
  }
  if (text.starts_with("LASF")) return CloudFormat::kLas;
  if (looks_like_draco_tiles(bytes)) return CloudFormat::kDracoTiles;
  for (const Signature& foreign : kForeign) {
    if (text.starts_with(foreign.start)) return unsupported(foreign.advice);
  }
  if (looks_like_pcd(bytes)) return CloudFormat::kPcd;
  if (looks_like_obj(bytes)) return CloudFormat::kObj;
  if (looks_like_xyz(bytes)) return CloudFormat::kXyz;
  return unsupported("the bytes are neither Draco, PLY, LAS, PCD or OBJ, nor lines of numbers");
}

std::string_view format_name(CloudFormat format) {
  switch (format) {
    case CloudFormat::kDraco:
      return "draco";
    case CloudFormat::kPly:
      return "ply";
    case CloudFormat::kObj:
      return "obj";
    case CloudFormat::kPcd:
      return "pcd";
    case CloudFormat::kLas:
      return "las";
    case CloudFormat::kDracoTiles:
      return "draco-tiles";
    case CloudFormat::kXyz:
      break;
  }
  return "xyz";
}

bool is_writable(CloudFormat format) {
  return format != CloudFormat::kObj && format != CloudFormat::kPcd;
}

Result<ImportedCloud> decode_cloud(std::span<const std::byte> bytes, CloudFormat format,
                                   const ImportParams& params) {
  if (bytes.empty()) return empty_error();
  switch (format) {
    case CloudFormat::kDraco:
      return read_draco(bytes, params);
    case CloudFormat::kPly:
      return read_ply(bytes, params);
    case CloudFormat::kObj:
      return read_obj(bytes, params);
    case CloudFormat::kPcd:
      return read_pcd(bytes, params);
    case CloudFormat::kLas:
      return read_las(bytes, params);
    case CloudFormat::kDracoTiles:
      return read_draco_tiles(bytes, params);
    case CloudFormat::kXyz:
      break;
  }
  return read_xyz(bytes, params);
}

Result<ImportedCloud> read_cloud(std::span<const std::byte> bytes, CloudFormat format,
                                 const ImportParams& params) {
  auto decoded = decode_cloud(bytes, format, params);
  if (!decoded) return decoded;
  return finish_cloud(std::move(decoded).value(), params);
}

Result<std::vector<std::byte>> write_cloud(const Cloud& cloud, CloudFormat format,
                                           const ExportParams& params) {
  if (cloud.size() == 0)
    return Error{.code = ErrorCode::kEmptyCloud, .message = "there are no samples", .field = {}};
  if (auto valid = validate(cloud); !valid) return valid.error();
  if (!is_writable(format)) {
    return unsupported(std::string(format_name(format)) + " files are read, not written");
  }
  const bool quantised = params.draco_position_bits != 0;
  if (quantised && (params.draco_position_bits < 8 || params.draco_position_bits > 30)) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "position bits are 0 (lossless) or 8 to 30, not " +
                            std::to_string(params.draco_position_bits),
                 .field = "draco_position_bits"};
  }
  if (quantised && format == CloudFormat::kXyz) {
    return unsupported("XYZ holds no quantised positions");
  }
  const bool is_draco = format == CloudFormat::kDraco || format == CloudFormat::kDracoTiles;
  if (quantised && !is_draco) {
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "only Draco quantises positions",
                 .field = "draco_position_bits"};
  }
  if (params.ascii && (is_draco || format == CloudFormat::kLas)) {
    const std::string name = format == CloudFormat::kLas ? "LAS" : "Draco";
    return Error{
        .code = ErrorCode::kInvalidArgument, .message = name + " has no text form", .field = "ascii"};
  }
  if (format == CloudFormat::kDracoTiles) return write_draco_tiles(cloud, params.draco_position_bits);
  const ExportView view(cloud, params.caller_order);
  switch (format) {
    case CloudFormat::kDraco:
      return write_draco(view, params.draco_position_bits);
    case CloudFormat::kPly:
      return write_ply(view, params.ascii);
    case CloudFormat::kLas:
      return write_las(view, params.grid);
    case CloudFormat::kDracoTiles:
    case CloudFormat::kObj:
    case CloudFormat::kPcd:
    case CloudFormat::kXyz:
      break;
  }
  return write_xyz(view);
}

}  // namespace pointwright
