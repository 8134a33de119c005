#pragma once
// Checked reading of query parameters and negotiation headers: unknown and repeated ones are refused, like
// members of a document.

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/outcome.h"
#include "server/http/message.h"

namespace pointwright::server {

/// Every parameter is one of `known`, which have blanks between them, and given once. Problem: kInvalidValue.
Outcome<Done> check_query(const RequestHead& head, std::string_view known);

/// The parameter's text, where it was given.
std::optional<std::string> query_value(const RequestHead& head, std::string_view name);

/// ?attributes=normal,t,detail,color,marks,ids,radius as the bits of a frame; `fallback` where it is absent.
Outcome<std::uint16_t> query_attributes(const RequestHead& head, std::uint16_t allowed,
                                        std::uint16_t fallback);

/// The entries of a comma-separated parameter, without blanks around them; none where it is absent or empty.
std::vector<std::string> query_list(const RequestHead& head, std::string_view name);

/// A whole number of at most 9 digits; nullopt where it is not given.
Outcome<std::optional<std::uint32_t>> query_number(const RequestHead& head, std::string_view name);

/// A number from 0 to 1; nullopt where it is not given.
Outcome<std::optional<double>> query_fraction(const RequestHead& head, std::string_view name);
/// Index of the parameter's text among `names`; nullopt where it is not given.
Outcome<std::optional<std::size_t>> query_choice(const RequestHead& head, std::string_view name,
                                                 std::span<const std::string_view> names);

/// A representation that can be given: what ?format= calls it, and its media type.
struct Format {
  std::string_view name;
  std::string_view media_type;
  std::string_view extension;
};
/// The format that ?format= names, or else the first that Accept lists, or else formats[0].
/// Problems: kInvalidValue, kNotAcceptable
Outcome<Format> negotiated_format(const RequestHead& head, const std::vector<Format>& formats);

/// Whether Accept names the media type (q=0 counts as not).
bool accepts(const RequestHead& head, std::string_view media_type);

/// A strong entity tag of the parts, joined by dashes.
std::string etag_of(std::initializer_list<std::string_view> parts);
/// Whether If-None-Match lists the tag.
bool is_unchanged(const RequestHead& head, const std::string& etag);
/// 304 with the tag.
Response not_modified(const std::string& etag);

/// Content-Disposition for a download: the name with everything unusual replaced.
std::string download_name(const std::string& name, std::string_view extension);

/// Whether the request prefers something (RFC 7240), such as "respond-async".
bool prefers(const RequestHead& head, std::string_view preference);

}  // namespace pointwright::server
