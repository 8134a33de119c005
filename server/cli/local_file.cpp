#include "server/cli/local_file.h"

#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "server/ingest/files.h"

namespace pointwright::server {

Result<std::vector<std::byte>> inflate_gzip(std::span<const std::byte> compressed, std::uint64_t max_bytes) {
  const auto malformed = [](const char* why) {
    return Error{.code = ErrorCode::kMalformedData,
                 .message = std::string("the gzip data is damaged: ") + why,
                 .field = {}};
  };
  z_stream stream{};
  if (inflateInit2(&stream, 15 + 16) != Z_OK) return malformed("the decompressor cannot start");
  std::vector<std::byte> result;
  int status = Z_OK;
  std::size_t consumed = 0;
  while (status != Z_STREAM_END || consumed < compressed.size()) {
    if (status == Z_STREAM_END && inflateReset(&stream) != Z_OK) break;  // a further member follows
    constexpr std::size_t kStep = 1U << 20U;
    const std::size_t before = result.size();
    result.resize(before + kStep);
    const std::size_t input = std::min<std::size_t>(compressed.size() - consumed, 1U << 30U);
    stream.next_in = const_cast<Bytef*>(
        reinterpret_cast<const Bytef*>(compressed.data() + consumed));  // NOLINT: zlib's C API
    stream.avail_in = static_cast<uInt>(input);
    stream.next_out = reinterpret_cast<Bytef*>(result.data() + before);
    stream.avail_out = static_cast<uInt>(kStep);
    status = inflate(&stream, Z_NO_FLUSH);
    consumed += input - stream.avail_in;
    const std::size_t made = kStep - stream.avail_out;
    result.resize(before + made);
    const bool stuck = made == 0 && stream.avail_in == input && status != Z_STREAM_END;
    if ((status != Z_OK && status != Z_STREAM_END) || stuck) {
      inflateEnd(&stream);
      return malformed(consumed == compressed.size() ? "it ends too early" : "a block is not valid");
    }
    if (result.size() > max_bytes) {
      inflateEnd(&stream);
      return Error{.code = ErrorCode::kTooLarge,
                   .message = "the inflated file is larger than " + std::to_string(max_bytes) + " bytes",
                   .field = {},
                   .limit = static_cast<double>(max_bytes)};
    }
  }
  inflateEnd(&stream);
  return result;
}

Result<ImportedCloud> read_local_cloud(const std::string& path, const ImportParams& params,
                                       std::uint64_t max_bytes) {
  auto bytes = read_file(path, max_bytes);
  if (!bytes) return bytes.error();
  std::vector<std::byte> content = std::move(bytes).value();
  const bool gzip = content.size() >= 2 && content[0] == std::byte{0x1f} && content[1] == std::byte{0x8b};
  if (gzip) {
    auto inflated = inflate_gzip(content, max_bytes);
    if (!inflated) return inflated.error();
    content = std::move(inflated).value();
  }
  const auto format = detect_format(content);
  if (!format) return format.error();
  return read_cloud(content, format.value(), params);
}

Result<CloudFormat> format_of_name(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".drc") return CloudFormat::kDraco;
  if (extension == ".ply") return CloudFormat::kPly;
  if (extension == ".las") return CloudFormat::kLas;
  if (extension == ".zip") return CloudFormat::kDracoTiles;
  if (extension == ".xyz" || extension == ".txt" || extension == ".asc") return CloudFormat::kXyz;
  return Error{.code = ErrorCode::kUnsupportedFormat,
               .message = "\"" + extension + "\" is not .drc, .ply, .las, .zip, .xyz, .txt or .asc",
               .field = {}};
}

}  // namespace pointwright::server
