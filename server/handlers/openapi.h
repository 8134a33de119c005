#pragma once
// The API's own description, compiled in.

#include <string>
#include <string_view>

namespace pointwright::server {

/// protocol/openapi.yaml, as it is.
std::string_view openapi_yaml();
/// The same as JSON.
const std::string& openapi_json();

}  // namespace pointwright::server
