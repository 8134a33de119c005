#include "server/handlers/query.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "protocol/frames/frame.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

Problem bad_parameter(const std::string& name, const std::string& detail) {
  return Problem{.kind = ProblemKind::kInvalidValue,
                 .detail = "the query parameter " + name.substr(0, 64) + " is not acceptable: " + detail,
                 .errors = {{.pointer = std::string(1, '?').append(name, 0, 64), .detail = detail}}};
}

/// The comma-separated entries of a header, without parameters and blanks; those with q=0 are left out.
std::vector<std::string> listed(std::string_view header) {
  std::vector<std::string> entries;
  while (!header.empty()) {
    const std::size_t end = std::min(header.find(','), header.size());
    std::string entry(header.substr(0, end));
    header.remove_prefix(std::min(end + 1, header.size()));
    entry.erase(std::remove_if(entry.begin(), entry.end(), [](char c) { return c == ' ' || c == '\t'; }),
                entry.end());
    const std::size_t quality = entry.find(";q=0");
    if (quality != std::string::npos && entry.find_first_not_of("0.", quality + 4) == std::string::npos)
      continue;
    entry.resize(std::min(entry.find(';'), entry.size()));
    if (!entry.empty()) entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace

Outcome<Done> check_query(const RequestHead& head, std::string_view known) {
  const auto is_known = [known](std::string_view name) {
    for (std::string_view rest = known; !rest.empty();) {
      const std::size_t end = std::min(rest.find(' '), rest.size());
      if (rest.substr(0, end) == name) return true;
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    return false;
  };
  for (std::size_t i = 0; i < head.query.size(); ++i) {
    const std::string& name = head.query[i].first;
    if (!is_known(name)) return bad_parameter(name, "it is unknown here");
    for (std::size_t j = 0; j < i; ++j)
      if (head.query[j].first == name) return bad_parameter(name, "it is given more than once");
  }
  return Done{};
}

std::optional<std::string> query_value(const RequestHead& head, std::string_view name) {
  for (const NameValue& entry : head.query)
    if (entry.first == name) return entry.second;
  return std::nullopt;
}

Outcome<std::uint16_t> query_attributes(const RequestHead& head, std::uint16_t allowed,
                                        std::uint16_t fallback) {
  constexpr std::array<std::pair<std::string_view, std::uint16_t>, 7> kNames = {
      {{"normal", protocol::kFrameNormal},
       {"t", protocol::kFrameT},
       {"detail", protocol::kFrameDetail},
       {"color", protocol::kFrameColor},
       {"marks", protocol::kFrameMarks},
       {"ids", protocol::kFrameIds},
       {"radius", protocol::kFrameRadius}}};
  const auto text = query_value(head, "attributes");
  if (!text) return fallback;
  std::uint16_t attributes = 0;
  for (const std::string& entry : listed(*text)) {
    const auto known =
        std::find_if(kNames.begin(), kNames.end(), [&](const auto& n) { return n.first == entry; });
    if (known == kNames.end() || (known->second & allowed) == 0)
      return bad_parameter("attributes",
                           "only normal, t, detail, color, marks, radius" +
                               std::string((allowed & protocol::kFrameIds) != 0 ? ", ids" : "") +
                               " can be asked for");
    attributes = static_cast<std::uint16_t>(attributes | known->second);
  }
  return attributes;
}

std::vector<std::string> query_list(const RequestHead& head, std::string_view name) {
  std::vector<std::string> entries;
  const std::string text = query_value(head, name).value_or("");
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    std::string entry = text.substr(begin, end - begin);
    entry.erase(0, std::min(entry.find_first_not_of(' '), entry.size()));
    entry.erase(entry.find_last_not_of(' ') + 1);
    if (!entry.empty()) entries.push_back(std::move(entry));
    begin = end + 1;
  }
  return entries;
}

Outcome<std::optional<std::uint32_t>> query_number(const RequestHead& head, std::string_view name) {
  const auto text = query_value(head, name);
  if (!text) return std::optional<std::uint32_t>();
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (text->empty() || text->size() > 9 || error != std::errc{} || end != text->data() + text->size())
    return bad_parameter(std::string(name), "a whole number is expected");
  return std::optional<std::uint32_t>(value);
}

Outcome<std::optional<double>> query_fraction(const RequestHead& head, std::string_view name) {
  const auto text = query_value(head, name);
  if (!text) return std::optional<double>();
  double value = 0.0;
  const char* const stop = text->data() + text->size();
  const auto [end, error] = std::from_chars(text->data(), stop, value);
  if (error != std::errc{} || end != stop || !(value >= 0.0 && value <= 1.0))
    return bad_parameter(std::string(name), "a number from 0 to 1 is expected");
  return std::optional<double>(value + 0.0);  // -0 is 0
}

Outcome<std::optional<std::size_t>> query_choice(const RequestHead& head, std::string_view name,
                                                 std::span<const std::string_view> names) {
  const auto text = query_value(head, name);
  if (!text) return std::optional<std::size_t>();
  std::string list;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == *text) return std::optional<std::size_t>(i);
    list += (list.empty() ? "" : ", ") + std::string(names[i]);
  }
  return bad_parameter(std::string(name), "it must be one of " + list);
}

Outcome<Format> negotiated_format(const RequestHead& head, const std::vector<Format>& formats) {
  if (const auto name = query_value(head, "format")) {
    for (const Format& format : formats)
      if (format.name == *name) return format;
    std::string names;
    for (const Format& format : formats) names += (names.empty() ? "" : ", ") + std::string(format.name);
    return bad_parameter("format", "it must be one of " + names);
  }
  const auto accept = head.header("accept");
  if (!accept) return formats.front();
  for (const std::string& entry : listed(*accept)) {
    if (entry == "*/*") return formats.front();
    for (const Format& format : formats)
      if (entry == format.media_type.substr(0, format.media_type.find(';'))) return format;
  }
  return Problem{.kind = ProblemKind::kNotAcceptable,
                 .detail = "Accept names none of the formats that can be given"};
}

bool accepts(const RequestHead& head, std::string_view media_type) {
  const auto entries = listed(head.header("accept").value_or(""));
  return std::find(entries.begin(), entries.end(), media_type) != entries.end();
}

std::string etag_of(std::initializer_list<std::string_view> parts) {
  std::string tag(1, '"');
  for (const std::string_view part : parts) {
    if (tag.size() > 1) tag.push_back('-');
    tag.append(part);
  }
  tag.push_back('"');
  return tag;
}

bool is_unchanged(const RequestHead& head, const std::string& etag) {
  const auto header = head.header("if-none-match");
  if (!header) return false;
  for (std::string entry : listed(*header)) {
    if (entry.rfind("W/", 0) == 0) entry.erase(0, 2);
    if (entry == etag || entry == "*") return true;
  }
  return false;
}

Response not_modified(const std::string& etag) {
  Response response{.status = 304};
  return response.with_header("ETag", etag);
}

std::string download_name(const std::string& name, std::string_view extension) {
  std::string plain;
  for (const char c : name) {
    const bool usual =
        (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
    plain.push_back(usual ? c : '-');
  }
  return "attachment; filename=\"" + (plain.empty() ? "cloud" : plain.substr(0, 80)) +
         std::string(extension) + "\"";
}

bool prefers(const RequestHead& head, std::string_view preference) {
  std::string_view rest = head.header("prefer").value_or("");
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(','), rest.size());
    std::string_view one = rest.substr(0, std::min(rest.find(';'), end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    const std::size_t first = std::min(one.find_first_not_of(" \t"), one.size());
    one.remove_prefix(first);
    one = one.substr(0, one.find_last_not_of(" \t") + 1);
    if (std::ranges::equal(one, preference, [](char a, char b) { return std::tolower(a) == b; })) return true;
  }
  return false;
}

}  // namespace pointwright::server
