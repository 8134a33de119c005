#pragma once
// Clouds as files to download.

#include "server/handlers/query.h"
#include "server/handlers/service.h"

namespace pointwright::server {

/// ply, draco, xyz.
const std::vector<Format>& cloud_file_formats();

/// The cloud in the caller's order, written on the background pool; 304 where the tag matches.
Response cloud_file_response(Service& service, const Request& request, std::shared_ptr<const Cloud> cloud,
                             const Format& format, const std::string& name, const std::string& etag);

}  // namespace pointwright::server
