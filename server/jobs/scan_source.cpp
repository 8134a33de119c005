#include "server/jobs/scan_source.h"

#include <fcntl.h>

#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/io/decoded_cloud.h"
#include "server/base/descriptor.h"
#include "server/cli/local_file.h"
#include "server/ingest/confined.h"
#include "server/ingest/files.h"

namespace pointwright::server {

Result<ImportedCloud> read_scan(const JobParams& params) {
  const ImportParams import{.max_samples = std::numeric_limits<std::uint32_t>::max() - 1U,
                            .drop_non_finite = params.drop_non_finite};
  if (!params.confined)
    return read_local_cloud(params.input, import, std::numeric_limits<std::uint64_t>::max());
  constexpr std::uint64_t kStartBytes = std::uint64_t{1} << 20U;  // enough to know the format by
  constexpr double kBytesPerSecond = 4.0 * 1024 * 1024;           // of decoding, at least
  const Descriptor file(::open(params.input.c_str(), O_RDONLY | O_CLOEXEC));
  std::error_code none;
  const std::uint64_t size = std::filesystem::file_size(params.input, none);
  std::vector<std::byte> start;
  const bool is_read =
      !none && file.is_open() &&
      read_pieces(file.get(), std::min(size, kStartBytes), [&](std::span<const std::byte> piece) {
        start.insert(start.end(), piece.begin(), piece.end());
        return true;
      });
  if (!is_read)
    return Error{
        .code = ErrorCode::kInvalidArgument, .message = "cannot read " + params.input, .field = "path"};
  const auto format = detect_format(start);
  if (!format) return format.error();
  ConfineLimits confine;
  if (params.most_bytes > 0) confine.memory_bytes = params.most_bytes;
  confine.deadline_seconds += static_cast<double>(size) / kBytesPerSecond;
  auto decoded = decode_confined(file.get(), size, format.value(), import, confine, nullptr);
  if (!decoded) return decoded.error();
  return finish_cloud(std::move(decoded).value(), import);
}

}  // namespace pointwright::server
