#pragma once
// One upload's two files: its bytes, whose number is its offset, and what it was announced as.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "engine/core/result.h"

namespace pointwright::server {

/// What a client announced, and what is kept of it beside the bytes.
struct UploadRecord {
  std::string id;
  std::uint64_t length = 0;  ///< bytes in the end
  std::string name;          ///< of the file, as the client calls it; may be empty
  std::string media_type;    ///< as the client calls it; may be empty
  std::string metadata;      ///< Upload-Metadata to the letter, to be told again
  std::string owner;         ///< token id; empty where no tokens are used
  std::chrono::system_clock::time_point created;
};

/// Writes the record beside the bytes, to the disk. Errors: those of write_file_atomically()
Result<void> write_upload_record(const std::string& folder, const UploadRecord& record);
/// Null where there is none that can be read.
std::optional<UploadRecord> read_upload_record(const std::string& folder, const std::string& id);

std::string upload_bytes_path(const std::string& folder, const std::string& id);
std::string upload_record_path(const std::string& folder, const std::string& id);
/// While it is there, only so many of the bytes count as it says: a checksum of the rest is still owed.
std::string upload_mark_path(const std::string& folder, const std::string& id);

}  // namespace pointwright::server
