#include "server/handlers/handlers.h"
#include "server/handlers/openapi.h"

namespace pointwright::server {

Response get_docs(Service&, const Request&) {
  return {.content_type = "text/html; charset=utf-8", .body = std::string(docs_file("docs.html"))};
}

Response get_docs_file(Service&, const Request& request) {
  const std::string name = request.head.path.substr(request.head.path.rfind('/') + 1);
  const bool is_style = name == "docs.css";
  return {.content_type = is_style ? "text/css; charset=utf-8" : "text/javascript; charset=utf-8",
          .body = std::string(docs_file(name))};
}

}  // namespace pointwright::server
