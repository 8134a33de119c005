#pragma once
// Clouds as files to download, single frames and long texts.

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud_io.h"
#include "server/handlers/query.h"
#include "server/handlers/service.h"

namespace pointwright::server {

inline constexpr std::string_view kFrameMediaType = "application/vnd.pointwright.frame";

/// ply, draco, xyz, las.
const std::vector<Format>& cloud_file_formats();

/// What of the cloud goes into the file, and how it is written.
struct FileOptions {
  bool ascii = false;                                    ///< PLY as text
  std::optional<std::vector<std::string>> attributes{};  ///< none: all that the cloud has

  [[nodiscard]] bool names(std::string_view attribute) const;
  /// What tells two files of one cloud in one format apart.
  [[nodiscard]] std::string tag() const;
};
/// ?attributes=normal,color,… and ?encoding=binary|ascii. Problem: invalid value
Outcome<FileOptions> query_file_options(const RequestHead& head, const Format& format);

struct CloudFile {
  Format format;
  std::string name;
  std::string etag;
  FileOptions options;
  std::optional<PositionGrid> grid;  ///< LAS: of the file that was uploaded
};
/// The cloud that `make` gives, as a file in the caller's order. Made and written on the background pool,
/// within the memory for answers, of which the file's bytes hold their part until they are sent.
/// `cloud_bytes`: memory_of() that cloud
/// Problems: overloaded, not acceptable (the format cannot hold the cloud), invalid value (an attribute that
/// the cloud does not have)
Response cloud_file_response(Service& service, const Request& request,
                             const std::function<std::shared_ptr<const Cloud>()>& make,
                             std::uint64_t cloud_bytes, const CloudFile& file);

/// A frame as an answer that holds its part of the memory for answers until it is sent.
/// Problem: overloaded
Outcome<Response> frame_answer(Service& service, const SharedFrame& frame);

/// A text as an answer that holds its part of the memory for answers until it is sent.
/// Problem: overloaded
Outcome<Response> text_answer(Service& service, std::string text, std::string content_type);

}  // namespace pointwright::server
