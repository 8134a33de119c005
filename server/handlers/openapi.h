#pragma once
// The API's own description, compiled in.

#include <string>
#include <string_view>

namespace pointwright::server {

/// protocol/openapi.yaml, as it is.
std::string_view openapi_yaml();
/// The same as JSON.
const std::string& openapi_json();

/// The page, the style and the script that show it: "docs.html", "docs.css", "docs.js"; else empty.
std::string_view docs_file(std::string_view name);

}  // namespace pointwright::server
