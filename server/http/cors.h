#pragma once
// Pages of other origins, where the operator lists them. Credentials of the browser's own are never asked
// for: callers send tokens.

#include <string>
#include <vector>

#include "server/http/message.h"

namespace pointwright::server {

/// Whether a browser asks here what it may ask.
bool is_preflight(const RequestHead& head);

/// What a page of the request's origin may ask: 204, with no permission for origins that are not listed.
Response preflight(const RequestHead& head, const std::vector<std::string>& origins);

/// Lets a listed origin read the answer and the headers that carry part of it.
void allow_reading(Response& response, const RequestHead& head, const std::vector<std::string>& origins);

}  // namespace pointwright::server
