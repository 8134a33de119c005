#pragma once
// Local files as clouds: format by content, gzip taken off.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/io/cloud_io.h"

namespace pointwright::server {

/// The bytes of a gzip file, inflated. Errors: kMalformedData, kTooLarge beyond max_bytes.
Result<std::vector<std::byte>> inflate_gzip(std::span<const std::byte> compressed, std::uint64_t max_bytes);

/// Reads a cloud file, gzip-compressed or not. Errors: those of reading, inflating and read_cloud().
Result<ImportedCloud> read_local_cloud(const std::string& path, const ImportParams& params,
                                       std::uint64_t max_bytes);

/// The format that a file's name asks for: .drc, .ply, .las, .xyz, .txt, .asc. Error: kUnsupportedFormat.
Result<CloudFormat> format_of_name(const std::string& path);

}  // namespace pointwright::server
