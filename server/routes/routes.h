#pragma once
// The one table of routes, and how a request finds its row.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/handlers/service.h"

namespace pointwright::server {

/// Who may use a row.
enum class Permission {
  kByMethod,  ///< reading takes the scope view, anything else edit
  kOpen,      ///< everybody, without a token
  kNoGuests,  ///< as kByMethod, but not those who came by a share link
  kOwner,     ///< edit, and not by a share link
  kAdmin,
};

/// One row. Patterns are plain text with the placeholders {id} (22 characters of base64url), {region} (zero
/// or one) and {slug} (lower-case letters, digits and dashes).
struct Route {
  Method method;
  std::string_view pattern;
  BodyPolicy::Kind body;
  Handler handler;
  Permission permission = Permission::kByMethod;
  bool once = false;  ///< an Idempotency-Key makes it have one effect
  /// The query parameters that it knows, with blanks between them; others are refused, but by what is open.
  std::string_view query = {};
};

std::span<const Route> all_routes();
/// "METHOD pattern" of all of them, and of the viewer's files.
std::vector<std::string> route_names();

/// Whether the path fits the pattern; what the placeholders matched goes to `captures`.
bool matches(std::string_view pattern, std::string_view path, std::vector<std::string>& captures);

/// Finds the row of a request: 404, 405 with Allow, 204 for OPTIONS, 401 and 403 by the caller and what it
/// may see, 429 by its quotas, or the endpoint. HEAD is answered by
/// GET's row. Uploads that could not be stored anyway are refused here, before their body is read.
Resolution resolve(Service& service, const RequestHead& head, const std::string& request_id);

}  // namespace pointwright::server
