#pragma once
// Uploads of files: in one request, or in parts that survive a break (tus 1.0).

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "server/cli/remote/service.h"

namespace pointwright::server {

struct UploadOptions {
  std::string file = {};
  std::string name = {};  ///< of the cloud; the file's where it is empty
  bool drop_non_finite = false;
  bool resume = false;  ///< in parts, whatever the size, and on with an upload that did not end
  std::uint64_t part_bytes = 8ULL << 20U;
  std::function<void(double fraction)> progress = {};
};

/// The file beside the uploaded one that remembers an upload until it has ended.
std::string memory_file_of(const std::string& file);

/// Uploads the file; answers the cloud's document. Files of 32 MiB and more go in parts where the server can.
/// Throws CommandFailure; after Ctrl-C too, and what has arrived then stays for --resume.
HttpAnswer upload_file(const RemoteService& service, const UploadOptions& options);

}  // namespace pointwright::server
