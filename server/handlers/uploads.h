#pragma once
// The tus protocol, version 1.0.0 (https://tus.io/protocols/resumable-upload): what its routes share.

#include <memory>
#include <optional>
#include <string_view>

#include "server/handlers/service.h"

namespace pointwright::server {

/// Whether the path is under /v1/uploads.
bool is_upload_path(std::string_view path);
/// The version that every request to uploads names, OPTIONS excepted. Problem: tus version
std::optional<Problem> check_tus(const RequestHead& head);
/// What every answer under /v1/uploads says; to OPTIONS and to a wrong version, everything that is offered.
Response with_tus_headers(const Service& service, Response response, bool is_offer);

/// What takes the body of POST /v1/uploads: an upload that is made for it.
Outcome<std::shared_ptr<BodyTarget>> open_new_upload(Service& service, const Request& request);
/// What takes the body of PATCH /v1/uploads/{id}.
Outcome<std::shared_ptr<BodyTarget>> open_upload(Service& service, const Request& request);

}  // namespace pointwright::server
