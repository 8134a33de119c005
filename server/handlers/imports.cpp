#include <string>
#include <vector>

#include "protocol/json/documents.h"
#include "server/handlers/handlers.h"

namespace pointwright::server {

Response list_imports(Service& service, const Request& request) {
  const auto may_see = [&](const std::string& owner) { return request.caller.may_see(owner); };
  return json_response(protocol::import_list(service.imports.list(may_see)));
}

Response get_import(Service& service, const Request& request) {
  const auto import = service.imports.find(request.captures.at(0));
  if (!import) return not_found("there is no such import", request);
  return json_response(protocol::to_json(*import));
}

Response delete_import(Service& service, const Request& request) {
  if (!service.imports.remove(request.captures.at(0))) return not_found("there is no such import", request);
  return {.status = 204};
}

}  // namespace pointwright::server
