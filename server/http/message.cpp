#include "server/http/message.h"

#include <algorithm>
#include <cctype>

namespace pointwright::server {

std::string_view method_name(Method method) {
  switch (method) {
    case Method::kGet:
      return "GET";
    case Method::kHead:
      return "HEAD";
    case Method::kPost:
      return "POST";
    case Method::kPut:
      return "PUT";
    case Method::kPatch:
      return "PATCH";
    case Method::kDelete:
      return "DELETE";
    case Method::kOptions:
      return "OPTIONS";
  }
  return "";
}

bool changes_state(Method method) {
  return method == Method::kPost || method == Method::kPut || method == Method::kPatch ||
         method == Method::kDelete;
}

std::optional<std::string_view> RequestHead::header(std::string_view name) const {
  for (const NameValue& entry : headers)
    if (entry.first == name) return entry.second;
  return std::nullopt;
}

std::string RequestHead::media_type() const {
  const auto value = header("content-type");
  if (!value) return {};
  std::string type(value->substr(0, value->find(';')));
  while (!type.empty() && (type.back() == ' ' || type.back() == '\t')) type.pop_back();
  std::transform(type.begin(), type.end(), type.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return type;
}

Response& Response::with_header(std::string name, std::string value) {
  headers.emplace_back(std::move(name), std::move(value));
  return *this;
}

}  // namespace pointwright::server
