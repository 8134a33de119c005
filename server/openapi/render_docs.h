#pragma once
// The API's description as a page to read. A build tool's part: nothing of it runs in the daemon.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace pointwright::docs {

using Json = nlohmann::ordered_json;

/// One page with everything: an index, the operations with their parameters, bodies, answers, examples and
/// curl lines, and the schemas. It asks for docs.css and docs.js and nothing else.
std::string render_page(const Json& api);

std::string_view style();
/// Narrows the index down to what is typed.
std::string_view script();

}  // namespace pointwright::docs
